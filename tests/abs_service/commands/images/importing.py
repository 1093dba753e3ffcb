"""Folders of images, and imports of them."""

import json
from pathlib import Path

import cv2
import numpy as np

from abs_service import cli
from drivers.contract.frame import Frame
from drivers.replay import Recording

CAMERA = """\
[depth]
width = 4
height = 3
fx = 4.0
fy = 4.0
cx = 1.5
cy = 1.0
"""
COLOR = CAMERA.replace("depth", "color") + "T_rs = { translation = [0.05, 0.0, 0.0] }\n"


def run(folder: Path, *options: str) -> int:
    """Exit code of an import of pairs to `folder / "out.mcap"`."""
    return cli.main(["import", str(folder), "--layout", "pairs", "--out", str(folder / "out.mcap"), *options])


def frames_of(path: Path) -> list[Frame]:
    """All images of a recording."""
    return list(Recording(path).images())


def open3d(folder: Path, name: str, **changes: object) -> list[str]:
    """A folder as Open3D's recorders write it; the arguments that import it."""
    for sensor, image in (("depth/000007.png", np.full((3, 4), 2000, np.uint16)), ("color/000007.jpg", None)):
        (folder / sensor).parent.mkdir()
        cv2.imwrite(str(folder / sensor), np.zeros((3, 4, 3), np.uint8) if image is None else image)
    matrix = [4.0, 0, 0, 0, 5.0, 0, 1.5, 1.0, 1]  # column by column
    given = {"width": 4, "height": 3, "intrinsic_matrix": matrix, "serial_number": "1"} | changes
    (folder / name).write_text(json.dumps(given))
    return ["import", str(folder), "--layout", "open3d", "--out", str(folder / "out.mcap")]
