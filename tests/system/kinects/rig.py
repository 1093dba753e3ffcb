"""A rig of two emulated Kinects and a simulated time-of-flight camera that look at the same simulated sheet.

The emulated cameras play sequences that were rendered from the scene of the simulated device. The scene starts with
its first exposure, which this process waits for on the bus to start the sequences. The sheet moves slowly, because the
sequences have a low frame rate, and a busy machine must not display an outdated pose.

  umockdev-run … -- python -m tests.system.kinects.rig FOLDER ENDPOINT      prints every estimate as `run` does
"""

import signal
import subprocess
import sys
import time
from pathlib import Path

from calib import pose
from drivers.simulated import address
from evaluation.service.kinect1_emulation import rendered_images
from evaluation.service.kinect1_emulation.testbed import SERIALS, Server
from tests.system.running import START_S, RigListener, wait_until

SCENE = "simulated://sheet?seed=1&sensors=tof&speed=0.05"

#: Length and frame rate of the sequences.
SEQUENCE_S, SEQUENCE_HZ = 60.0, 2

#: Number of estimates with every camera that are sufficient, and timeout for them [s].
ESTIMATES, PATIENCE_S = 30, 30.0

#: Names and poses of the Kinects, on both sides of the time-of-flight camera.
POSES = {name: pose.look_at((x, -0.05, 0.0), (0.0, 0.0, 1.0)) for name, x in (("left", -0.25), ("right", 0.25))}


def write_rig(path: Path, endpoint: str) -> None:
    """The rig's configuration."""
    parts = [
        f'version = 1\nname = "kinects"\n\n[bus]\nendpoint = "{endpoint}"\n',
        f'[devices.sim]\nuri = "{SCENE}"\n\n[sensors.tof]\ndevice = "sim"\n',
        '[sensors.tof.noise]\ntype = "gaussian_polynomial"\namplitudes = [400.0, 10000.0]',
        "sigma = [[1.0425e-2, -2.8187e-6, 3.5261e-10, -1.5195e-14], [5.0e-4, 0.0, 0.0, 0.0]]\n",
    ]
    for (name, T_rs), serial in zip(POSES.items(), SERIALS):
        T_rc = T_rs @ rendered_images.PLANE.color_camera().T_rs
        parts += [
            f'[devices.{name}]\nuri = "kinect1://{serial}"\n',
            f'[sensors.{name}_depth]\ndevice = "{name}"\nhead = "depth"\ncamera = {{ T_rs = {T_rs.tolist()} }}',
            'noise = { type = "structured_light", noise = 1.425e-3, step = 2.89e-3 }\n',
            f'[sensors.{name}_color]\ndevice = "{name}"\nhead = "color"\ncamera = {{ T_rs = {T_rc.tolist()} }}',
            'noise = { type = "bayer", sigma = 12.0 }\n',
        ]
    sensors = ["tof", *(f"{name}_{head}" for name in POSES for head in ("depth", "color"))]
    parts += [
        '[synchronisation]\nreference = "tof/depth"\ntolerance_ms = 25.0\n',
        f"[trackers.sheet]\nsensors = {sensors}\n".replace("'", '"'),
        '[trackers.sheet.model]\ntype = "nurbs"\ncontrol_points = [4, 4]\ndegree = 2\n',
        "[record]\nenabled = false\n",
    ]
    path.write_text("\n".join(parts), encoding="utf-8")


def main(folder: Path, endpoint: str) -> None:
    """Renders the sequences, runs the rig, plays the sequences and stops the rig when it has tracked for a while."""
    scene = address.parse(SCENE).build().scene
    sequences = [folder / f"{name}.npz" for name in POSES]
    for sequence, T_rs in zip(sequences, POSES.values()):
        rendered_images.render(sequence, scene, T_rs, SEQUENCE_S, SEQUENCE_HZ)
    rig = folder / "rig.toml"
    write_rig(rig, endpoint)
    with Server("--sequences", *map(str, sequences)) as server:
        command = [sys.executable, "-m", "abs_service", "run", str(rig), "--json"]
        with subprocess.Popen(command) as process, RigListener(endpoint, rig="kinects") as listener:
            wait_until(lambda: listener.frames("tof/depth/image"), START_S, "an image of the simulated camera")
            first = listener.frames("tof/depth/image")[0]
            server.send(f"play {first.header.t_host_ns - round(first.seq * 1e9 / 30)} {SEQUENCE_HZ}")
            wait_until(listener.states, START_S, "an estimate")
            # TRACKING means with every camera: on a busy machine images are late, so it may take a while.
            enough, end_s = listener.tracks_since(0, ESTIMATES), time.monotonic() + PATIENCE_S
            wait_until(lambda: enough() or time.monotonic() > end_s, START_S, "the end")
            process.send_signal(signal.SIGTERM)
            process.wait(20)
        sys.exit(process.returncode)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
