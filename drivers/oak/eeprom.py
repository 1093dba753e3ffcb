"""Extrinsics of an OAK's cameras: from its factory calibration as JSON, or from image metadata.

The device stores for each camera a pose that maps its coordinates to those of another one, in centimetres. Source:
depthai-core 3.12, CalibrationHandler (MIT), against which this is tested.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from calib import pose
from calib.formats.depthai import UNITS_M
from calib.pose import Pose

#: Socket number that means none.
NO_SOCKET = -1

#: Size [px] and camera matrix with which rectifications are computed; they do not depend on them.
_SIZE, _MATRIX = (640, 400), np.array([[500.0, 0, 320], [0, 500, 200], [0, 0, 1]])


class EepromError(ValueError):
    """An unusable calibration; names the problem."""


@dataclass(frozen=True, slots=True, eq=False)
class Extrinsics:
    """The pose that maps coordinates of a camera, or of a view of one, to those of the camera at socket `to` [m]."""

    to: int
    T_to_camera: Pose


#: Pose of a camera without a neighbour, or without a calibration.
UNKNOWN = Extrinsics(NO_SOCKET, pose.identity())


def extrinsics_of(rotation: ArrayLike, translation: ArrayLike, socket: int, unit: int) -> Extrinsics:
    """Extrinsics in depthai's representation; `UNKNOWN` if they are none.

    Args:
        rotation: (3, 3), empty without.
        translation: (3,) in depthai's unit number `unit`.
        socket: number of the camera that the coordinates are mapped to.
        unit: index in `calib.formats.depthai.UNITS_M`.
    """
    try:
        return Extrinsics(socket, pose.from_rotation(rotation, UNITS_M[unit] * np.asarray(translation, float)))
    except (ValueError, IndexError, TypeError):
        return UNKNOWN


@dataclass(frozen=True, eq=False)
class Poses:
    """The cameras of one device.

    Attributes:
        extrinsics: by socket.
        rectifications: by socket, the rotation from a stereo camera's coordinates to its rectified ones; devices may
            not store them.
        pair: sockets of the left and of the right stereo camera; None if unknown.
    """

    extrinsics: Mapping[int, Extrinsics] = field(default_factory=dict)
    rectifications: Mapping[int, Pose] = field(default_factory=dict)
    pair: tuple[int, int] | None = None

    def between(self, reference: int, socket: int) -> Pose:
        """The pose that maps coordinates of the camera at `socket` to those of the one at `reference` [m].

        Raises:
            EepromError: their extrinsics are not connected.
        """
        return self.between_views(Extrinsics(reference, pose.identity()), Extrinsics(socket, pose.identity()))

    def between_views(self, reference: Extrinsics, view: Extrinsics) -> Pose:
        """The pose that maps coordinates of a view to those of the view `reference` [m].

        Raises:
            EepromError: their extrinsics are not connected.
        """
        root, T_root_camera = self._to_root(view.to)
        root_of_reference, T_root_reference = self._to_root(reference.to)
        if root != root_of_reference:
            raise EepromError(f"nothing is known of where camera {view.to} is relative to camera {reference.to}")
        return pose.inverse(T_root_reference @ reference.T_to_camera) @ T_root_camera @ view.T_to_camera

    def rectified(self, socket: int) -> Pose:
        """The pose that maps coordinates of a stereo camera to those of its rectified image.

        What the device does not store is computed from the extrinsics as depthai does it, by OpenCV's `stereoRectify`
        (depthai-core, src/pipeline/node/Rectification.cpp).

        Raises:
            EepromError: the camera is not part of the stereo pair.
        """
        if socket in self.rectifications:
            return self.rectifications[socket]
        if self.pair is None or socket not in self.pair:
            stereo = sorted(self.rectifications) if self.pair is None else sorted(self.pair)
            raise EepromError(f"camera {socket} is none of the stereo pair {stereo}")
        left, right = self.pair
        T_right_left, straight = self.between(right, left), np.zeros(5)
        try:
            R, t = T_right_left[:3, :3], T_right_left[:3, 3:].copy()
            found = cv2.stereoRectify(_MATRIX, straight, _MATRIX, straight, _SIZE, R, t)
            return pose.from_rotation(found[self.pair.index(socket)], (0, 0, 0))
        except (ValueError, cv2.error) as error:
            raise EepromError(f"the stereo pair {self.pair} cannot be rectified: {error}") from error

    def _to_root(self, socket: int) -> tuple[int, Pose]:
        T, seen = pose.identity(), {socket}
        while socket in self.extrinsics and self.extrinsics[socket].to != NO_SOCKET:
            extrinsics = self.extrinsics[socket]
            if extrinsics.to in seen:
                raise EepromError(f"the poses of cameras {sorted(seen)} go round in a circle")
            T, socket = extrinsics.T_to_camera @ T, extrinsics.to
            seen.add(socket)
        return socket, T


def parse(content: str | bytes) -> Poses:
    """Poses of a calibration in the JSON format of `CalibrationHandler.eepromToJson`.

    Raises:
        EepromError: malformed JSON, or invalid poses.
    """
    try:
        eeprom = json.loads(content)
        extrinsics = {int(socket): _extrinsics(camera["extrinsics"]) for socket, camera in eeprom["cameraData"]}
        stereo = eeprom.get("stereoRectificationData") or {}
        rotations = {
            int(stereo[f"{side.lower()}CameraSocket"]): pose.from_rotation(
                stereo[f"rectifiedRotation{side}"], (0, 0, 0)
            )
            for side in ("Left", "Right")
            if stereo.get(f"rectifiedRotation{side}")
        }
        sockets = [int(stereo.get(f"{side}CameraSocket", NO_SOCKET)) for side in ("left", "right")]
        pair = (sockets[0], sockets[1]) if NO_SOCKET not in sockets and sockets[0] != sockets[1] else None
        return Poses(extrinsics, rotations, pair)
    except KeyError as error:
        raise EepromError(f"the calibration lacks {error}") from error
    except (ValueError, TypeError, AttributeError, IndexError, OverflowError, RecursionError) as error:
        raise EepromError(f"the calibration is not understood: {error}") from error


def _extrinsics(extrinsics: Mapping[str, Any]) -> Extrinsics:
    rotation, t = extrinsics["rotationMatrix"], extrinsics["translation"]
    if not rotation:
        return Extrinsics(NO_SOCKET, pose.identity())
    translation = UNITS_M[int(extrinsics.get("lengthUnit", 1))] * np.array([t["x"], t["y"], t["z"]], float)
    return Extrinsics(int(extrinsics["toCameraSocket"]), pose.from_rotation(rotation, translation))
