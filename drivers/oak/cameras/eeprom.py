"""Extrinsics of an OAK's cameras: from its factory calibration as JSON, or from image metadata.

The device stores for each camera a pose that maps its coordinates to those of another one, in centimetres. Source:
depthai-core 3.12, CalibrationHandler (MIT), against which this is tested.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib import pose
from calib.pose import Pose

#: Metres per depthai's numbered length units: metre, centimetre (default), millimetre, inch, foot.
UNITS_M = (1.0, 0.01, 0.001, 0.0254, 0.3048)

#: Socket number that means none.
NO_SOCKET = -1


class EepromError(ValueError):
    """An unusable calibration; names the problem."""


@dataclass(frozen=True, slots=True, eq=False)
class Extrinsics:
    """The pose that maps coordinates of a camera to those of the camera at socket `to` [m]."""

    to: int
    T_to_camera: Pose


@dataclass(frozen=True, eq=False)
class Poses:
    """The cameras of one device.

    Attributes:
        extrinsics: by socket.
        rectifications: by socket, the rotation from a stereo camera's coordinates to its rectified ones.
    """

    extrinsics: Mapping[int, Extrinsics] = field(default_factory=dict)
    rectifications: Mapping[int, Pose] = field(default_factory=dict)

    def between(self, reference: int, socket: int) -> Pose:
        """The pose that maps coordinates of the camera at `socket` to those of the one at `reference` [m].

        Raises:
            EepromError: their extrinsics are not connected.
        """
        root, T_root_camera = self._to_root(socket)
        root_of_reference, T_root_reference = self._to_root(reference)
        if root != root_of_reference:
            raise EepromError(f"nothing is known of where camera {socket} is relative to camera {reference}")
        return pose.inverse(T_root_reference) @ T_root_camera

    def rectified(self, socket: int) -> Pose:
        """The pose that maps coordinates of a stereo camera to those of its rectified image.

        Raises:
            EepromError: the camera is not part of the stereo pair.
        """
        if socket not in self.rectifications:
            raise EepromError(f"camera {socket} is none of the stereo pair {sorted(self.rectifications)}")
        return self.rectifications[socket]

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
        return Poses(extrinsics, rotations)
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
