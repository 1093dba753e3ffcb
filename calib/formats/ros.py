"""ROS CameraInfo as YAML: one camera, no pose.

Files of `camera_calibration_parsers` and messages as `ros2 topic echo` and `rostopic echo` print them are read.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

from calib.camera import Camera
from calib.files import nested
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
    only,
    placed,
)
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import LensModel

_KNOWN = (
    "image_width", "image_height", "camera_name", "camera_matrix", "distortion_model", "distortion_coefficients",
    "rectification_matrix", "projection_matrix",
)  # fmt: skip

#: Keys of a message, and those of a file.
_OF_MESSAGES = {
    "width": "image_width", "height": "image_height", "K": "camera_matrix", "D": "distortion_coefficients",
    "R": "rectification_matrix", "P": "projection_matrix",
}  # fmt: skip

#: Names by REP 127 and by OpenCV.
_FISHEYES = ("equidistant", "fisheye", "kannala_brandt")


def read(text: str, hints: Hints) -> Content:
    """The camera, named by its `camera_name`.

    Raises:
        FormatError: the text is not a CameraInfo.
    """
    try:
        info = _as_file(_first_document(text))
    except ValueError as error:
        raise FormatError(str(error)) from error
    try:
        matrix = focal(_numbers(info["camera_matrix"], 9).reshape(3, 3))
        lens = _lens(info.get("distortion_model", "plumb_bob"), _numbers(info["distortion_coefficients"]))
        one = camera((info["image_width"], info["image_height"]), matrix, lens)
    except KeyError as error:
        raise FormatError(f"{error.args[0]} is missing") from None
    except (TypeError, AttributeError) as error:
        raise FormatError(f"no CameraInfo: {error}") from error
    lost = extra("file", info, _KNOWN)
    if "rectification_matrix" in info and not np.array_equal(
        _numbers(info["rectification_matrix"], 9), np.eye(3).ravel()
    ):
        lost += ("rectification_matrix and projection_matrix: images are used as they are, not rectified",)
    projection = _numbers(info["projection_matrix"], 12).tolist() if "projection_matrix" in info else [0.0] * 12
    if projection[3]:
        lost += (f"projection_matrix: it stands {-projection[3] / projection[0]:g} m beside another camera, along x",)
    return Content({str(info.get("camera_name") or hints.name): one}, lost)


def write(cameras: Mapping[str, Camera]) -> Written:
    """One camera, with identity rectification.

    Raises:
        FormatError: several cameras.
    """
    name, one = only(cameras, "CameraInfo")
    matrix = [one.fx, 0.0, one.cx, 0.0, one.fy, one.cy, 0.0, 0.0, 1.0]
    model, coefficients = _distortion(one.lens)
    projection = [one.fx, 0.0, one.cx, 0.0, 0.0, one.fy, one.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    info = {
        "image_width": one.width,
        "image_height": one.height,
        "camera_name": name,
        "camera_matrix": _table(3, 3, matrix),
        "distortion_model": model,
        "distortion_coefficients": _table(1, len(coefficients), coefficients),
        "rectification_matrix": _table(3, 3, np.eye(3).ravel().tolist()),
        "projection_matrix": _table(3, 4, projection),
    }
    return Written(yaml.safe_dump(info, default_flow_style=None, sort_keys=False, width=200), placed(cameras))


def _first_document(text: str) -> Any:
    """A file, which may begin with a line `---`, or the first of messages, each of which ends with one."""
    try:
        return nested.yaml(text)
    except ValueError:
        return nested.yaml(text.partition("\n---")[0])


def _as_file(info: Any) -> Any:
    """A message with the keys of a file; ROS 2 prints its matrices' names in small letters."""
    if not isinstance(info, dict) or "camera_matrix" in info:
        return info
    header = info.get("header")
    name = header.get("frame_id", "") if isinstance(header, dict) else ""
    named = {_OF_MESSAGES.get(key, _OF_MESSAGES.get(str(key).upper(), key)): info[key] for key in info}
    named = {key: {"data": value} if isinstance(value, list) else value for key, value in named.items()}
    return {key: value for key, value in named.items() if key != "header"} | {"camera_name": name}


def _table(rows: int, columns: int, data: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": [float(number) for number in data]}


def _numbers(table: Any, count: int | None = None) -> Any:
    try:
        numbers = np.array([float(number) for number in table["data"]])
    except (TypeError, ValueError) as error:
        raise FormatError(f"numbers have to be in a table, as data: […]: {error}") from None
    if count is not None and numbers.size != count:
        raise FormatError(f"{count} numbers are needed, not {numbers.size}")
    return numbers


def _lens(model: str, numbers: Any) -> LensModel:
    if model in _FISHEYES:
        return fisheye(numbers)
    if model in {"plumb_bob", "rational_polynomial"}:
        return brown_conrady(numbers)
    raise FormatError(f"the distortion {model} cannot be expressed; plumb_bob, rational_polynomial, equidistant can")


def _distortion(lens: LensModel) -> tuple[str, list[float]]:
    if isinstance(lens, KannalaBrandt):
        return "equidistant", lens.coefficients.tolist()
    rational = bool(np.any(lens.coefficients[5:]))
    return (
        ("rational_polynomial", lens.coefficients.tolist())
        if rational
        else ("plumb_bob", lens.coefficients[:5].tolist())
    )
