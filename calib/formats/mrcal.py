"""mrcal's `.cameramodel`: a Python literal for one camera, whose pose maps the reference to it. Source: its manual."""

import ast
from collections.abc import Mapping
from typing import Any

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.formats.content import Content, FormatError, Hints, Written, brown_conrady, camera, extra, only
from calib.lenses.lens import Lens

#: Coefficients after fx, fy, cx, cy, by lens model.
COEFFICIENTS = {
    "LENSMODEL_PINHOLE": 0,
    "LENSMODEL_OPENCV4": 4,
    "LENSMODEL_OPENCV5": 5,
    "LENSMODEL_OPENCV8": 8,
    "LENSMODEL_OPENCV12": 12,
}

#: Older and newer names of the rotation vector and translation from the reference to the camera.
_EXTRINSICS = ("extrinsics", "rt_cam_ref")


def read(text: str, hints: Hints) -> Content:
    """The camera, in a rig whose frame is mrcal's reference.

    Raises:
        FormatError: invalid text, or a lens that cannot be expressed.
    """
    try:
        model: Any = ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, RecursionError, MemoryError) as error:
        raise FormatError(f"no camera model of mrcal: {error}") from error
    try:
        kind, intrinsics, size = (
            model["lensmodel"],
            [float(number) for number in model["intrinsics"]],
            model["imagersize"],
        )
        extrinsics = np.array(next(model[key] for key in _EXTRINSICS if key in model), float)
    except (KeyError, TypeError, ValueError) as error:
        raise FormatError(f"no camera model of mrcal: {error}") from error
    except StopIteration:
        raise FormatError("no camera model of mrcal: extrinsics is missing") from None
    if kind not in COEFFICIENTS:
        raise FormatError(f"the lens {kind} cannot be expressed; {', '.join(COEFFICIENTS)} can")
    if len(intrinsics) != 4 + COEFFICIENTS[kind] or extrinsics.shape != (6,):
        raise FormatError(f"{kind} has {4 + COEFFICIENTS[kind]} intrinsics and 6 extrinsics")
    T_rs = pose.inverse(pose.from_rotation_vector(extrinsics[:3], extrinsics[3:]))
    one = camera(size, intrinsics[:4], brown_conrady(intrinsics[4:]), T_rs)
    return Content({hints.name: one}, extra(hints.name, model, ("lensmodel", "intrinsics", "imagersize", *_EXTRINSICS)))


def write(cameras: Mapping[str, Camera]) -> Written:
    """One camera, with the shortest lens model that has all its coefficients.

    Raises:
        FormatError: several cameras, or a lens outside OpenCV's models.
    """
    name, one = only(cameras, "a .cameramodel")
    if not isinstance(one.lens, Lens):
        raise FormatError(
            f"{name}: mrcal has no fisheye of Kannala and Brandt; fit LENSMODEL_SPLINED… to it with mrcal"
        )
    used = len(np.trim_zeros(one.lens.coefficients, "b"))
    kind, count = next((kind, count) for kind, count in COEFFICIENTS.items() if count >= used)
    intrinsics = [one.fx, one.fy, one.cx, one.cy, *one.lens.coefficients[:count].tolist()]
    rotation_vector, translation = pose.to_rotation_vector(one.T_sr)
    lines = [
        f"    'lensmodel':  '{kind}',",
        f"    'intrinsics': [{_list(intrinsics)}],",
        f"    # rotation vector and translation from the reference, which is the rig, to {name}",
        f"    'extrinsics': [{_list([*rotation_vector, *translation])}],",
        f"    'imagersize': [{one.width}, {one.height}],",
    ]
    return Written("\n".join(["{", *lines, "}", ""]), (f"the name {name}, but for the file's",))


def _list(numbers: list[float]) -> str:
    return ", ".join(repr(float(number)) for number in numbers)
