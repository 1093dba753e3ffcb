"""A rig of today: its configuration, and a recording of it as its recorder makes one, from the simulated device."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import tomli_w
from absmsg.v1.common_pb2 import Header

from abs_service.capture.mcap_writing import write_cameras, write_frame
from drivers.encoding.mcap_file import Compression, McapFile
from drivers.simulated.address import parse
from evaluation.service.live.rig import demo_table

#: Name of the rig and of its tracker.
NAME, TRACKER = "today", "sheet"
#: Exposures per second.
RATE_HZ = 30.0
#: Largest size of an exposure: two depth images and one in colour [bytes].
EXPOSURE_BYTES = 2 * 2 * 640 * 480 + 3 * 1280 * 720
#: What the service's recorder keeps on disk of what it writes [bytes].
KEPT_BYTES = 4_000_000_000
#: Beginning of the recorded time, host and wall clock [ns].
_BEGIN_NS = 1_700_000_000_000_000_000

#: Noise of the depth head: radial distances with amplitudes, and z without.
NOISES: Mapping[str, Mapping[str, Any]] = {
    "tof": {
        "type": "gaussian_polynomial",
        "sigma": [[1.0425e-2, -2.8187e-6, 3.5261e-10, -1.5195e-14], [5.0e-4, 0.0, 0.0, 0.0]],
        "amplitudes": [400.0, 10000.0],
    },
    "structured_light": {"type": "structured_light", "noise": 1.425e-3, "step": 2.85e-3},
}


def address(head: str, seed: int) -> str:
    """The simulated device: depth of 640 × 480 and colour of 1280 × 720 pixels."""
    return f"simulated://sheet?seed={seed}&rate={RATE_HZ:g}&sensors={head},color&{head}=640x480&color=1280x720"


def configuration(head: str, uris: Sequence[str], trackers: int = 1) -> str:
    """TOML of trackers like the demo's with 600 vertices and 6 × 6 control points, on one or more cameras.

    Args:
        head: the depth head of every camera.
        uris: of the cameras; all are where the first one is.
        trackers: number of equal ones, each on all cameras.
    """
    rig = demo_table(NAME)
    noises = {head: NOISES[head], "color": rig["sensors"]["color"]["noise"]}
    rig["devices"] = {f"camera{k}": {"uri": uri} for k, uri in enumerate(uris)}
    rig["sensors"] = {
        (name if k == 0 else f"{name}{k}"): {"device": f"camera{k}", "head": name, "noise": noise}
        for k in range(len(uris))
        for name, noise in noises.items()
    }
    # Cameras that nobody triggers are apart by up to half of their interval.
    rig["synchronisation"] = {"reference": f"{head}/depth", "tolerance_ms": 12.0 if len(uris) == 1 else 17.0}
    rig["record"] |= {"estimates": True, "rotate_bytes": 1_000_000_000, "retain_bytes": KEPT_BYTES}
    tracker = rig["trackers"][TRACKER]
    tracker["sensors"] = list(rig["sensors"])
    tracker["model"]["control_points"] = [6, 6]
    tracker["mesh"]["vertices"] = 600
    rig["trackers"] = {(TRACKER if k == 0 else f"{TRACKER}{k}"): tracker for k in range(trackers)}
    return tomli_w.dumps(rig)


def replayed(take: Path, delay_s: float, speed: float = 1.0) -> str:
    """Address of a recording as a live device, at a multiple of its own speed."""
    return f"replay://{quote(str(take))}?delay={delay_s:g}&speed={speed:g}"


def write_take(path: Path, head: str, seed: int, exposures: int, progress: Callable[[str], None]) -> Path:
    """Records exposures of the simulated device, compressed as the recorder does by default."""
    simulation = parse(address(head, seed)).build()
    with path.open("wb") as stream:
        file = McapFile(stream, Compression.LZ4)
        file.attach("rig.toml", "text/toml", configuration(head, [address(head, seed)]).encode(), _BEGIN_NS)
        cameras = {name: one.camera for name, one in simulation.heads.items()}
        write_cameras(file, Header(rig=NAME), cameras, _BEGIN_NS)
        for k in range(exposures):
            if k % 30 == 0:
                progress(f"exposure {k} of {exposures}")
            for frame in simulation.frames(k):
                write_frame(file, frame, Header(rig=NAME, seq=frame.seq), _BEGIN_NS + frame.t_host_ns)
        file.finish()
    return path
