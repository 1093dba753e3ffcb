"""Kalibr's camera chain (`camchain.yaml`). Source: its wiki, page "yaml formats".

`cam0` is the origin; `T_cn_cnm1` of every other camera maps the previous camera's coordinates to its own.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

from calib import pose
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
    relative,
    rigid,
)
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensModel

_KNOWN = (
    "camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution", "T_cn_cnm1", "rostopic",
    "cam_overlaps",
)  # fmt: skip


def read(text: str, hints: Hints) -> Content:
    """Cameras of a chain, named by the first part of their ROS topics if unique, otherwise `cam0` ….

    Raises:
        FormatError: not a chain of pinhole cameras.
    """
    try:
        chain = nested.yaml(text)
    except ValueError as error:
        raise FormatError(str(error)) from error
    tables = {key: chain[key] for key in _cams(chain)}
    if not tables:
        raise FormatError("no camera chain: cam0 is missing")
    T_rs = pose.identity()
    names = _names(tables)
    cameras: dict[str, Camera] = {}
    lost: tuple[str, ...] = ()
    for key, table in tables.items():
        try:
            T_rs = T_rs @ pose.inverse(rigid(table["T_cn_cnm1"])) if cameras else T_rs
            if table["camera_model"] != "pinhole":
                raise FormatError(f"the projection {table['camera_model']} cannot be expressed, only pinhole")
            lens = _lens(table["distortion_model"], table["distortion_coeffs"])
            cameras[names[key]] = camera(table["resolution"], table["intrinsics"], lens, T_rs)
        except KeyError as error:
            raise FormatError(f"{key}: {error.args[0]} is missing") from None
        except (FormatError, TypeError, ValueError) as error:
            raise FormatError(f"{key}: {error}") from None
        lost += extra(key, table, _KNOWN)
    return Content(cameras, lost)


def write(cameras: Mapping[str, Camera]) -> Written:
    """Chain of all cameras in their order.

    Raises:
        FormatError: a lens has more than k1, k2, p1, p2 and is no fisheye.
    """
    chain: dict[str, Any] = {}
    before = pose.identity()
    for index, (name, one) in enumerate(cameras.items()):
        model, coefficients = _distortion(name, one.lens)
        link = {"T_cn_cnm1": (one.T_sr @ before).tolist()} if index else {}
        chain[f"cam{index}"] = {
            "cam_overlaps": [other for other in range(len(cameras)) if other != index],
            "camera_model": "pinhole",
            "distortion_model": model,
            "distortion_coeffs": coefficients,
            "intrinsics": [float(number) for number in (one.fx, one.fy, one.cx, one.cy)],
            "resolution": [one.width, one.height],
            "rostopic": f"/{name}/image_raw",
            **link,
        }
        before = one.T_rs
    return Written(yaml.safe_dump(chain, default_flow_style=None, sort_keys=False, width=200), relative(cameras))


def _cams(chain: Any) -> list[str]:
    keys = [key for key in chain if str(key)[:3] == "cam" and str(key)[3:].isdigit()] if isinstance(chain, dict) else []
    return sorted((key for key in keys if isinstance(chain[key], dict)), key=lambda key: int(key[3:]))


def _names(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    firsts = {key: str(table.get("rostopic", "")).strip("/").partition("/")[0] for key, table in tables.items()}
    distinct = len(set(firsts.values())) == len(firsts) and all(firsts.values())
    return firsts if distinct else {key: key for key in tables}


def _lens(model: str, coefficients: Any) -> LensModel:
    numbers = [float(number) for number in coefficients]
    match model:
        case "radtan":
            return brown_conrady(numbers)
        case "equidistant":
            return fisheye(numbers)
        case "none":
            return Lens()
    raise FormatError(f"the distortion {model} cannot be expressed; radtan, equidistant and none can")


def _distortion(name: str, lens: LensModel) -> tuple[str, list[float]]:
    if isinstance(lens, KannalaBrandt):
        return "equidistant", lens.coefficients.tolist()
    if np.any(lens.coefficients[4:]):
        raise FormatError(f"{name}: Kalibr's radtan has k1, k2, p1, p2, this lens k3 … k6 besides")
    return "radtan", lens.coefficients[:4].tolist()
