"""Detection of a mirrored sensor from the board's roll in two sensors' images."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from calib.board.board_pose_features import board_pose_features, extent
from calib.board.views import CornerView

#: Minimum number of common shots.
MIN_SHARED = 5
#: Agreement of the rolls in two images, 0 to 1: below the first they disagree, above the second they agree.
_AGAINST, _FOR = 0.7, 0.97


class MirroredSensorError(ValueError):
    """Opposite sense of rotation of the board in the images of two sensors."""


def check(views: Sequence[CornerView]) -> None:
    """Checks that no sensor's views are mirrored relative to another's.

    The mirror image of a chessboard or a grid is again one, so a single image is not sufficient. But a board that is
    rolled rotates in the same sense in the images of all sensors that see its print, unless one of them is mirrored. A
    board that was never rolled passes.

    Raises:
        MirroredSensorError: names both sensors; which of the two is mirrored is not determined.
    """
    rolls: dict[str, dict[int, float]] = {}
    for sensor in dict.fromkeys(view.sensor for view in views):
        seen = [view for view in views if view.sensor == sensor]
        size = extent(seen)
        rolls[sensor] = {view.shot: board_pose_features(view, size).roll for view in seen}
    for first, second in combinations(rolls, 2):
        shared = sorted(rolls[first].keys() & rolls[second].keys())
        if len(shared) < MIN_SHARED:
            continue
        a, b = (np.array([rolls[sensor][shot] for shot in shared]) for sensor in (first, second))
        # Twice the angle, because a board may be numbered from either end.
        same, opposite = (abs(np.exp(2j * (a - sign * b)).mean()) for sign in (1, -1))
        if opposite > _FOR and same < _AGAINST:
            raise MirroredSensorError(
                f"{first} or {second} sees the board as in a mirror: it turns clockwise in one's images when it turns "
                "anticlockwise in the other's. Switch off the mirroring of that camera or its driver"
            )
