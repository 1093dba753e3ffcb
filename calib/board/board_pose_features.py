"""Features of a board's pose in an image, computable without calibration; used to tell views apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from calib import pose
from calib.board.views import CornerView

#: A board has moved if it differs by this in position (of half the image), size (a factor), or roll [rad].
_PLACE, _SIZE, _ROLL = 0.2, 1.2, np.deg2rad(16)


@dataclass(frozen=True, slots=True)
class BoardPose:
    """Approximate pose of a board in an image.

    Attributes:
        place: position of its centre in the image, from (-1, -1), the upper left corner, to (1, 1), the lower right.
        size: the larger of its width and height, relative to the image's.
        tilt: rotation to the sides and up and down [rad]: the viewing direction of the print, as seen by the sensor,
            has positive components for right and down.
        roll: angle of its rows in the image [rad].
    """

    place: tuple[float, float]
    size: float
    tilt: tuple[float, float]
    roll: float


def board_pose_features(view: CornerView, size: tuple[int, int]) -> BoardPose:
    """Approximate pose of the board in a view of an image of width and height `size` [px].

    The focal length is assumed to be the image's longer side (53° field of view); for other lenses tilts are wrong by
    up to a factor of 1.5.
    """
    low, high = view.pixels.min(axis=0), view.pixels.max(axis=0)
    middle, half = (np.array(size) - 1) / 2, np.array(size) / 2
    place = ((low + high) / 2 - middle) / half
    share = float(np.max((high - low) / np.array(size)))
    ideal = np.ascontiguousarray((view.pixels - middle) / max(size))
    found, rotation, _ = cv2.solvePnP(view.points_b, ideal, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        return BoardPose((float(place[0]), float(place[1])), share, (0.0, 0.0), 0.0)
    R = pose.from_rotation_vector(rotation.ravel(), np.zeros(3))[:3, :3]
    # The print faces the negative z axis of the board.
    across, along = (float(np.arcsin(np.clip(-R[axis, 2], -1, 1))) for axis in (0, 1))
    roll = float(np.arctan2(R[1, 0], R[0, 0]))
    return BoardPose((float(place[0]), float(place[1])), share, (across, along), roll)


def moved(a: BoardPose, b: BoardPose) -> bool:
    """True if two poses differ enough in place, size or roll to count as two; tilts are not certain enough."""
    place = max(abs(x - y) for x, y in zip(a.place, b.place))
    roll = abs((a.roll - b.roll + np.pi) % (2 * np.pi) - np.pi)
    ratio = max(a.size, b.size) / max(min(a.size, b.size), 1e-9)
    return place > _PLACE or roll > _ROLL or ratio > _SIZE


def extent(views: Sequence[CornerView]) -> tuple[int, int]:
    """Width and height that contain the corners of all views [px], for an unknown image size."""
    largest = np.max([view.pixels.max(axis=0) for view in views], axis=0)
    return int(largest[0]) + 2, int(largest[1]) + 2
