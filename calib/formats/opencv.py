"""OpenCV's FileStorage, YAML, XML or JSON, with the keys of its samples and of many programs.

One camera is at the top level (`camera_matrix`, `distortion_coefficients`, as in the sample calibration.cpp), two are
`M1, D1, M2, D2` with `R, T` (stereo_calib.cpp), several in a map each.
"""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from calib import pose
from calib.camera import Camera
from calib.formats import file_storage
from calib.formats.content import (
    Content,
    FormatError,
    Hints,
    Written,
    brown_conrady,
    camera,
    extra,
    fisheye,
    focal,
    rigid,
)
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import LensModel
from calib.pose import Pose

_MATRICES = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "M1", "M2")
_DISTORTIONS = (
    "distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "dist_coeff", "dist", "D", "D1",
    "D2",
)  # fmt: skip
#: Other keys with such a part may hold a lens, which must not be lost.
_OF_A_LENS = ("dist", "coef")
#: Kinds of lenses that four coefficients may be those of.
FISHEYE, BROWN_CONRADY = "fisheye", "brown-conrady"
FISHEYE_COEFFICIENTS = 4
#: Names of a fisheye as `distortion_model`: ours, OpenCV's and those of ROS.
FISHEYE_NAMES = (KannalaBrandt.name, "fisheye", "equidistant", "kannala_brandt", "kannala_brandt4")

_SIZES = ("img_size", "image_size", "imageSize", "size")
_WIDTHS = ("image_width", "image_Width", "width")
_HEIGHTS = ("image_height", "image_Height", "height")
_ERRORS = ("avg_reprojection_error", "Avg_Reprojection_Error")
#: Largest reprojection error of a calibration, as a share of the image's width.
_MAX_ERROR = 0.01
#: Largest difference of elements of two rotations that are rounded.
_RECTIFIED = 1e-3
_KNOWN = (
    *_MATRICES, *_DISTORTIONS, *_SIZES, *_WIDTHS, *_HEIGHTS, "T_rs", "R", "T", "camera_name", "distortion_model",
    "fisheye_model", "xi",
)  # fmt: skip


def read(text: str, hints: Hints) -> Content:
    """All cameras of a storage.

    Raises:
        FormatError: no camera, or an image size that neither the text nor the hints contain.
    """
    root = file_storage.parse(text)
    if not isinstance(root, dict):
        raise FormatError("an empty FileStorage")
    if hints.pair and "M1" in root:
        root = {**root, **file_storage.parse(hints.pair)}
    if "M1" in root and "M2" in root:
        return _stereo(root, hints)
    name = str(root.get("camera_name") or hints.name)
    tables = {name: root} if _find(root, _MATRICES) is not None else root
    cameras = {
        key: _camera(key, table, hints)
        for key, table in tables.items()
        if isinstance(table, dict) and _find(table, _MATRICES) is not None
    }
    if not cameras:
        alone = "; R and T say where two cameras stand: give the file with M1 and M2 as well" if _is_pair(root) else ""
        raise FormatError(f"no camera: none of the keys {', '.join(_MATRICES)}{alone}")
    lost = (part for key in cameras for part in extra(key, tables[key], _KNOWN))
    return Content(cameras, tuple(lost))


def is_pair(text: str) -> bool:
    """True for a file of stereo_calib.cpp that says where two cameras stand, and not what they are (extrinsics.yml)."""
    try:
        root = file_storage.parse(text)
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        TypeError,
        ValueError,
    ):  # of a damaged file, or another format
        return False
    return isinstance(root, dict) and _is_pair(root)


def _is_pair(root: Mapping[str, Any]) -> bool:
    return {"R", "T"} <= {*root} and _find(root, _MATRICES) is None


def write(cameras: Mapping[str, Camera], dialect: int = cv2.FILE_STORAGE_FORMAT_YAML) -> Written:
    """One camera at the top level, several in a map each; with T_rs besides OpenCV's own keys."""
    storage = cv2.FileStorage("", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY | dialect)
    for name, one in cameras.items():
        if len(cameras) > 1:
            storage.startWriteStruct(name, cv2.FILE_NODE_MAP)
        else:
            storage.write("camera_name", name)
        storage.write("image_width", one.width)
        storage.write("image_height", one.height)
        storage.write("camera_matrix", np.array([[one.fx, 0, one.cx], [0, one.fy, one.cy], [0, 0, 1]]))
        storage.write("distortion_model", one.lens.name)
        storage.write("distortion_coefficients", one.lens.coefficients.reshape(-1, 1))
        storage.write("T_rs", one.T_rs)
        if len(cameras) > 1:
            storage.endWriteStruct()
    return Written(storage.releaseAndGetString())


def _find(table: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    return next((table[key] for key in keys if table.get(key) is not None), None)


def _camera(name: str, table: Mapping[str, Any], hints: Hints) -> Camera:
    size = _find(table, _SIZES)
    if size is None:
        size = (_find(table, _WIDTHS), _find(table, _HEIGHTS))
    size = np.ravel(np.array(size)).tolist()
    if None in size:
        if hints.size is None:
            raise FormatError(f"{name}: the size of the image is missing; give it as --size WIDTHxHEIGHT")
        size = list(hints.size)
    error = _find(table, _ERRORS)
    if error is not None and float(error) > _MAX_ERROR * float(size[0]):
        raise FormatError(
            f"{name}: corners missed by {float(error):.3g} px when it was calibrated, which is no calibration of this "
            "camera: calibrate anew"
        )
    T_rs = rigid(table["T_rs"]) if table.get("T_rs") is not None else pose.identity()
    try:
        return camera(size, focal(_find(table, _MATRICES)), _lens(table, hints), T_rs)
    except FormatError as error:
        raise FormatError(f"{name}: {error}") from None


def _lens(table: Mapping[str, Any], hints: Hints) -> LensModel:
    coefficients = _find(table, _DISTORTIONS)
    if coefficients is None and (other := _maybe_a_lens(table)):
        raise FormatError(f"{other}: is this the lens? Call it {_DISTORTIONS[0]}")
    numbers = np.zeros(0) if coefficients is None else np.ravel(np.asarray(coefficients, float))
    if np.any(table.get("xi")):
        raise FormatError("xi: the omnidirectional model cannot be expressed by our lenses")
    said = FISHEYE if _is_fisheye(table) else BROWN_CONRADY if table.get("distortion_model") else ""
    if hints.lens and said and hints.lens != said:
        raise FormatError(f"--lens {hints.lens}: the file says {said}")
    if numbers.size == FISHEYE_COEFFICIENTS and np.any(numbers) and not (said or hints.lens):
        raise FormatError(
            f"four coefficients, {numbers.tolist()}, are k1 k2 p1 p2 or those of a fisheye: say which with --lens "
            f"{BROWN_CONRADY} or --lens {FISHEYE}"
        )
    return fisheye(numbers) if FISHEYE in (said, hints.lens) else brown_conrady(numbers)


def _maybe_a_lens(table: Mapping[str, Any]) -> str:
    """An unknown key that may hold coefficients of a lens; "" if there is none."""
    keys = (key for key, value in table.items() if isinstance(value, np.ndarray | list) and key not in _KNOWN)
    return next((key for key in keys if any(part in key.lower() for part in _OF_A_LENS)), "")


def _is_fisheye(table: Mapping[str, Any]) -> bool:
    return str(table.get("distortion_model")).lower() in FISHEYE_NAMES or bool(table.get("fisheye_model"))


def _stereo(root: Mapping[str, Any], hints: Hints) -> Content:
    """Stereo pair whose left camera is the origin; x_right = R x_left + T."""
    left, right = (
        {key.removesuffix(side): value for key, value in root.items() if key not in other}
        for side, other in (("1", ("M2", "D2")), ("2", ("M1", "D1")))
    )
    cameras = {"left": _camera("left", _sided(left), hints), "right": _camera("right", _sided(right), hints)}
    lost = extra("file", root, _KNOWN)
    if root.get("R") is None or root.get("T") is None:
        return Content(cameras, (*lost, "nothing is said of where right is: R and T are missing"))
    T_rl = rigid(np.hstack([np.array(root["R"], float), np.array(root["T"], float).reshape(3, 1)]))
    _check_rectified(root, T_rl)
    one = cameras["right"]
    matrix = (one.fx, one.fy, one.cx, one.cy)
    moved = camera((one.width, one.height), matrix, one.lens, pose.inverse(T_rl))
    return Content(cameras | {"right": moved}, lost)


def _check_rectified(root: Mapping[str, Any], T_rl: Pose) -> None:
    """Rejects R that turns the cameras otherwise than the rectification in the same file does."""
    rectifications = [np.asarray(root[key], float) for key in ("R1", "R2") if root.get(key) is not None]
    if len(rectifications) < 2:
        return
    first, second = rectifications
    if first.shape == second.shape == (3, 3) and not np.allclose(second @ T_rl[:3, :3], first, atol=_RECTIFIED):
        raise FormatError(
            "R does not fit R1 and R2 of the same file, as R2 R = R1: is R transposed, or of the other direction? "
            "x_right = R x_left + T"
        )


def _sided(table: Mapping[str, Any]) -> dict[str, Any]:
    return {{"M": "K"}.get(key, key): value for key, value in table.items()}
