"""How a board stands in an image, roughly: enough to tell views apart before any camera is known."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from calib import pose
from calib.views import CornerView

#: Two stances differ by so much in place (of half the image), in size (a factor), or in an angle [rad].
_PLACE, _SIZE, _ANGLE = 0.2, 1.2, np.deg2rad(8)


@dataclass(frozen=True, slots=True)
class Stance:
    """How a board stands.

    Attributes:
        place: of its middle in the image, (-1, -1) the upper left corner and (1, 1) the lower right one.
        size: the larger of its width and height, as part of the image's.
        tilt: angles that it is turned by to the sides and up and down [rad]: the direction that its print faces, as
            the sensor sees it, has positive components for right and down.
        roll: angle of its rows in the image [rad].
    """

    place: tuple[float, float]
    size: float
    tilt: tuple[float, float]
    roll: float


def stance(view: CornerView, size: tuple[int, int]) -> Stance:
    """How the board stands in a view of an image of width and height `size` [px].

    The focal length is taken to be the image's longer side, a lens of 53°; tilts of other lenses come out as too small
    or too large by up to a half.
    """
    low, high = view.pixels.min(axis=0), view.pixels.max(axis=0)
    middle, half = (np.array(size) - 1) / 2, np.array(size) / 2
    place = ((low + high) / 2 - middle) / half
    share = float(np.max((high - low) / np.array(size)))
    ideal = np.ascontiguousarray((view.pixels - middle) / max(size))
    found, rotation, _ = cv2.solvePnP(view.points_b, ideal, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    if not found:
        return Stance((float(place[0]), float(place[1])), share, (0.0, 0.0), 0.0)
    R = pose.from_rotation_vector(rotation.ravel(), np.zeros(3))[:3, :3]
    # The print faces away from z of the board.
    across, along = (float(np.arcsin(np.clip(-R[axis, 2], -1, 1))) for axis in (0, 1))
    roll = float(np.arctan2(R[1, 0], R[0, 0]))
    return Stance((float(place[0]), float(place[1])), share, (across, along), roll)


def differs(a: Stance, b: Stance) -> bool:
    """Whether two stances are different enough to be two views."""
    place = max(abs(x - y) for x, y in zip(a.place, b.place))
    tilt = max(abs(x - y) for x, y in zip(a.tilt, b.tilt))
    roll = abs((a.roll - b.roll + np.pi) % (2 * np.pi) - np.pi)
    ratio = max(a.size, b.size) / max(min(a.size, b.size), 1e-9)
    return place > _PLACE or tilt > _ANGLE or roll > 2 * _ANGLE or ratio > _SIZE


def extent(views: Sequence[CornerView]) -> tuple[int, int]:
    """A width and height that all views fit into, for when those of the image are not known [px]."""
    largest = np.max([view.pixels.max(axis=0) for view in views], axis=0)
    return int(largest[0]) + 2, int(largest[1]) + 2
