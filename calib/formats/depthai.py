"""DepthAI's calibration, the JSON of `CalibrationHandler.eepromToJsonFile`: lengths in centimetres, cameras by socket.

A camera may have a pose relative to one other: `extrinsics` map its coordinates to those of `toCameraSocket`.
"""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

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
    fisheye,
    focal,
    relative,
    rigid,
)
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import LensModel
from calib.pose import Pose

#: Metres per numbered length unit: metre, centimetre (the default), millimetre, inch, foot.
UNITS_M = (1.0, 0.01, 0.001, 0.0254, 0.3048)

_NOWHERE = -1
_PERSPECTIVE, _FISHEYE = 0, 1
_COEFFICIENTS = 14


def read(text: str, hints: Hints) -> Content:
    """Cameras by socket, `cam_a` for 0, in the frame of the camera at the root of all extrinsics.

    Raises:
        FormatError: invalid text, or a lens that cannot be expressed.
    """
    try:
        eeprom = nested.json(text)
        tables = {int(socket): table for socket, table in eeprom["cameraData"] if table.get("intrinsicMatrix")}
        links = {socket: _link(table["extrinsics"]) for socket, table in tables.items()}
        cameras: dict[str, Camera] = {}
        lost = ["what is not of cameras: board, IMU, stereo rectification, housing"]
        roots: set[int] = set()
        for socket, table in sorted(tables.items()):
            root, T_rs = _to_root(socket, links)
            roots.add(root)
            matrix = focal(np.array(table["intrinsicMatrix"], float).reshape(3, 3))
            lens = _lens(int(table.get("cameraType", _PERSPECTIVE)), table["distortionCoeff"])
            cameras[_name(socket)] = camera((table["width"], table["height"]), matrix, lens, T_rs)
    except KeyError as error:
        raise FormatError(f"no calibration of DepthAI: {error} is missing") from None
    except FormatError:
        raise
    except (ValueError, TypeError, AttributeError, IndexError) as error:
        raise FormatError(f"no calibration of DepthAI: {error}") from error
    if len(roots) > 1:
        lost.append(f"nothing connects {', '.join(map(_name, sorted(roots)))}: all of them are at the rig's origin")
    return Content(cameras, tuple(lost))


def write(cameras: Mapping[str, Camera]) -> Written:
    """Calibration with the first camera at socket 0, the second at socket 1, …, all linked to the first."""
    first = next(iter(cameras.values()))
    data: list[list[Any]] = []
    for socket, one in enumerate(cameras.values()):
        T_to_s = first.T_sr @ one.T_rs
        x, y, z = (100 * T_to_s[:3, 3]).tolist()
        extrinsics = {
            "lengthUnit": 1,
            "rotationMatrix": T_to_s[:3, :3].tolist() if socket else [],
            "specTranslation": {"x": x, "y": y, "z": z},
            "toCameraSocket": 0 if socket else _NOWHERE,
            "translation": {"x": x, "y": y, "z": z},
        }
        padding = [0.0] * (_COEFFICIENTS - one.lens.coefficients.size)
        table = {
            "cameraType": _FISHEYE if isinstance(one.lens, KannalaBrandt) else _PERSPECTIVE,
            "distortionCoeff": one.lens.coefficients.tolist() + padding,
            "extrinsics": extrinsics,
            "height": one.height,
            "intrinsicMatrix": [[one.fx, 0.0, one.cx], [0.0, one.fy, one.cy], [0.0, 0.0, 1.0]],
            "lensPosition": 0,
            "specHfovDeg": float(np.rad2deg(2 * np.arctan(one.width / (2 * one.fx)))),
            "width": one.width,
        }
        data.append([socket, table])
    names = ", ".join(f"{name} is {_name(socket)}" for socket, name in enumerate(cameras))
    text = json.dumps({"version": 7, "cameraData": data}, indent=1) + "\n"
    return Written(text, (*relative(cameras), f"the names: {names}"))


def _name(socket: int) -> str:
    return f"cam_{chr(ord('a') + socket)}"


def _lens(kind: int, coefficients: Any) -> LensModel:
    if kind == _FISHEYE:
        return fisheye(coefficients)
    if kind == _PERSPECTIVE:
        return brown_conrady(coefficients)
    raise FormatError(
        f"cameraType {kind} cannot be expressed; {_PERSPECTIVE} (perspective) and {_FISHEYE} (fisheye) can"
    )


def _link(extrinsics: Mapping[str, Any]) -> tuple[int, Pose]:
    rotation, t = extrinsics["rotationMatrix"], extrinsics["translation"]
    if not rotation:
        return _NOWHERE, pose.identity()
    translation = UNITS_M[int(extrinsics.get("lengthUnit", 1))] * np.array([[t["x"]], [t["y"]], [t["z"]]], float)
    return int(extrinsics["toCameraSocket"]), rigid(np.hstack([np.array(rotation, float), translation]))


def _to_root(socket: int, links: Mapping[int, tuple[int, Pose]]) -> tuple[int, Pose]:
    """Root camera of a chain of extrinsics, and the pose of the socket in it."""
    T, seen = pose.identity(), {socket}
    while socket in links and links[socket][0] != _NOWHERE:
        to, T_to_s = links[socket]
        if to in seen:
            raise FormatError(f"the extrinsics of cameras {sorted(seen)} go round in a circle")
        T, socket = T_to_s @ T, to
        seen.add(socket)
    return socket, T
