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

_MATRICES = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "M1", "M2")
_DISTORTIONS = (
    "distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "dist", "D", "D1", "D2",
)  # fmt: skip
#: Kinds of lenses that four coefficients may be those of.
FISHEYE, BROWN_CONRADY = "fisheye", "brown-conrady"
FISHEYE_COEFFICIENTS = 4
#: Names of a fisheye as `distortion_model`: ours, OpenCV's and those of ROS.
FISHEYE_NAMES = (KannalaBrandt.name, "fisheye", "equidistant", "kannala_brandt", "kannala_brandt4")

_SIZES = ("img_size", "image_size", "imageSize", "size")
_WIDTHS = ("image_width", "image_Width", "width")
_HEIGHTS = ("image_height", "image_Height", "height")
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
        raise FormatError(f"no camera: none of the keys {', '.join(_MATRICES)}")
    lost = (part for key in cameras for part in extra(key, tables[key], _KNOWN))
    return Content(cameras, tuple(lost))


def write(cameras: Mapping[str, Camera], dialect: int = cv2.FILE_STORAGE_FORMAT_YAML) -> Written:
    """One camera at the top level, several in a map each; with T_rs besides OpenCV's own keys.

    Args:
        cameras: cameras to write.
        dialect: a `cv2.FILE_STORAGE_FORMAT_…`.
    """
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
    T_rs = rigid(table["T_rs"]) if table.get("T_rs") is not None else pose.identity()
    try:
        return camera(size, focal(_find(table, _MATRICES)), _lens(table, hints), T_rs)
    except FormatError as error:
        raise FormatError(f"{name}: {error}") from None


def _lens(table: Mapping[str, Any], hints: Hints) -> LensModel:
    coefficients = _find(table, _DISTORTIONS)
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
    one = cameras["right"]
    matrix = (one.fx, one.fy, one.cx, one.cy)
    moved = camera((one.width, one.height), matrix, one.lens, pose.inverse(T_rl))
    return Content(cameras | {"right": moved}, lost)


def _sided(table: Mapping[str, Any]) -> dict[str, Any]:
    return {{"M": "K"}.get(key, key): value for key, value in table.items()}
