"""The measured rig: the demo rig with a colour camera of full size, on a free port."""

import socket
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w

#: What the rig and its tracker are called.
NAME, TRACKER = "end_to_end", "sheet"
#: Its streams: sensor and stream of each.
STREAMS = (("tof", "depth"), ("tof", "amplitude"), ("color", "color"))
#: The sensor whose exposures become estimates.
REFERENCE = "tof"
#: The simulated device: time of flight with 176 × 144 and colour with 640 × 480 pixels, both 30 Hz.
URI = "simulated://sheet?seed={seed}&color=640x480"


def write_rig(folder: Path, seed: int) -> Path:
    """Writes the rig's configuration into a folder; its recordings go to `takes` beside it.

    Args:
        folder: an existing, empty folder.
        seed: of the simulated motion and noise.
    """
    rig = demo_table(NAME)
    rig["devices"]["sim"]["uri"] = URI.format(seed=seed)
    path = folder / "rig.toml"
    path.write_text(tomli_w.dumps(rig), encoding="utf-8")
    return path


def demo_table(name: str) -> dict[str, Any]:
    """The demo rig as a table, under another name and on a free port; it records to `takes` beside it."""
    text = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
    rig: dict[str, Any] = tomllib.loads(text)
    rig["name"] = name
    rig["bus"]["endpoint"] = f"tcp/127.0.0.1:{free_port()}"
    rig["record"] |= {"enabled": True, "directory": "takes"}
    return rig


def endpoint_of(rig: Path) -> str:
    """Endpoint of the rig of a configuration."""
    return str(tomllib.loads(rig.read_text(encoding="utf-8"))["bus"]["endpoint"])


def free_port() -> int:
    """A TCP port that is not in use."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
