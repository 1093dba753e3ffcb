"""COLMAP's cameras project as COLMAP says, and what is none is refused with its line."""

import numpy as np
import pytest

from calib.formats import colmap
from calib.formats.content import FormatError, Hints

HINTS = Hints("tof")


@pytest.mark.parametrize(
    ("line", "pixel"),
    [
        ("SIMPLE_PINHOLE 640 480 500 321 238", (621.0, 463.0)),
        ("PINHOLE 640 480 500 505 321 238", (621.0, 465.25)),
        ("SIMPLE_RADIAL 640 480 500 321 238 -0.1", (604.125, 450.34375)),
        ("RADIAL 640 480 500 321 238 -0.1 0.03", (606.972656, 452.479492)),
        ("OPENCV 640 480 500 505 321 238 -0.1 0.03 0.001 -0.002", (605.960156, 454.567475)),
        (
            "FULL_OPENCV 640 480 500 505 321 238 -0.1 0.03 0.001 -0.002 0.01 0.02 -0.01 0.005",
            (603.945335, 453.041247),
        ),
        ("SIMPLE_RADIAL_FISHEYE 640 480 300 321 238 0.02", (476.719321, 354.789491)),
        ("RADIAL_FISHEYE 640 480 300 321 238 0.02 -0.01", (476.454497, 354.590872)),
        ("OPENCV_FISHEYE 640 480 300 305 321 238 0.02 -0.01 0.003 -0.001", (476.482854, 356.555676)),
    ],
)
def test_a_camera_of_colmap_projects_as_there(line: str, pixel: tuple[float, float]) -> None:
    """Pixels are those that pycolmap 4.2.1 gives, `Camera.img_from_cam`; its pixels have their middle at a half."""
    (one,) = colmap.read(f"# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n7 {line}\n", HINTS).cameras.values()
    np.testing.assert_allclose(one.project(np.array((0.6, 0.45, 1.0))), np.subtract(pixel, 0.5), atol=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 FOV 640 480 500 500 320 240 1", "line 1: the model FOV cannot be expressed; SIMPLE_PINHOLE, "),
        ("#\n1 OPENCV 640 480 500 500 320 240", "line 2: OPENCV has 8 parameters, not 4"),
        ("1 PINHOLE 640 480 a 500 320 240", "line 1: could not convert string to float: 'a'"),
        ("1 PINHOLE 640 480 5 5 3 2\n1 PINHOLE 640 480 5 5 3 2", "line 2: the camera 1 is there twice"),
        ("# nothing", "no camera: a line has CAMERA_ID MODEL"),
    ],
)
def test_what_is_no_camera_of_colmap_is_refused_with_its_line(text: str, said: str) -> None:
    with pytest.raises(FormatError, match=said):
        colmap.read(text, HINTS)
