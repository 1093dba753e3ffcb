"""COLMAP's `cameras.txt`: intrinsics by number. Source: its documentation, page "Output Format", and `sensor/models.h`.

The middle of COLMAP's upper left pixel is (½, ½), ours (0, 0). Poses are those of images there, in another file.
"""

from collections.abc import Mapping

import numpy as np

from calib.camera import Camera
from calib.formats.content import Content, FormatError, Hints, Written, brown_conrady, camera, fisheye, placed
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import LensModel

#: Models: number of focal lengths, number of coefficients of the lens, and True for a fisheye.
_MODELS = {
    "SIMPLE_PINHOLE": (1, 0, False),
    "PINHOLE": (2, 0, False),
    "SIMPLE_RADIAL": (1, 1, False),
    "RADIAL": (1, 2, False),
    "OPENCV": (2, 4, False),
    "FULL_OPENCV": (2, 8, False),
    "SIMPLE_RADIAL_FISHEYE": (1, 1, True),
    "RADIAL_FISHEYE": (1, 2, True),
    "OPENCV_FISHEYE": (2, 4, True),
}


def read(text: str, hints: Hints) -> Content:
    """Cameras of a list, called `camera1` … by their numbers, or as the hints say if there is only one.

    Raises:
        FormatError: not such a list, or a model that our lenses cannot express; names the line.
    """
    cameras: dict[str, Camera] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not (words := line.split("#", 1)[0].split()):
            continue
        try:
            name = f"camera{int(words[0])}"
            if name in cameras:
                raise FormatError(f"the camera {words[0]} is there twice")
            cameras[name] = _camera(words[1], words[2:4], [float(word) for word in words[4:]])
        except (IndexError, ValueError) as error:  # of which FormatError is one
            raise FormatError(f"line {number}: {error}") from None
    if not cameras:
        raise FormatError("no camera: a line has CAMERA_ID MODEL WIDTH HEIGHT PARAMS")
    if len(cameras) == 1:
        return Content(dict(zip([hints.name], cameras.values())))
    return Content(cameras, ("where the cameras stand: COLMAP has that in other files, and all are in one place here",))


def write(cameras: Mapping[str, Camera]) -> Written:
    """List of all cameras, numbered from 1 in their order."""
    lines = ["# Camera list with one line of data per camera:", "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    lines.append(f"# Number of cameras: {len(cameras)}")
    for number, one in enumerate(cameras.values(), 1):
        model, coefficients = _model(one.lens)
        numbers = [one.fx, one.fy, one.cx + 0.5, one.cy + 0.5, *coefficients]
        lines.append(f"{number} {model} {one.width} {one.height} {' '.join(repr(float(each)) for each in numbers)}")
    numbered = ", ".join(f"{name} is {number}" for number, name in enumerate(cameras, 1))
    return Written("\n".join(lines) + "\n", (f"names: {numbered}", *placed(cameras)))


def _camera(model: str, size: list[str], numbers: list[float]) -> Camera:
    if model not in _MODELS:
        raise FormatError(f"the model {model} cannot be expressed; {', '.join(_MODELS)} can")
    focal, count, is_fisheye = _MODELS[model]
    if len(numbers) != focal + 2 + count:
        raise FormatError(f"{model} has {focal + 2 + count} parameters, not {len(numbers)}")
    cx, cy, *coefficients = numbers[focal:]
    # Of the radial models k1 and k2 come first in our lenses, too.
    lens = fisheye(coefficients) if is_fisheye else brown_conrady(coefficients)
    return camera(size, (numbers[0], numbers[focal - 1], cx - 0.5, cy - 0.5), lens)


def _model(lens: LensModel) -> tuple[str, list[float]]:
    if isinstance(lens, KannalaBrandt):
        return "OPENCV_FISHEYE", lens.coefficients.tolist()
    if lens.is_pinhole:
        return "PINHOLE", []
    count = 8 if np.any(lens.coefficients[4:]) else 4
    return ("FULL_OPENCV" if count == 8 else "OPENCV"), lens.coefficients[:count].tolist()
