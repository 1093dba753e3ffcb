"""Whether one of two sensors sees boards as in a mirror, from how they turn in both images."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from calib.board.board_pose_features import extent, stance
from calib.views import CornerView

#: Moments that two sensors must have in common for this to be told.
LEAST_SHARED = 5
#: How well turns in two images agree, 0 to 1: below the first they do not, above the second they do.
_AGAINST, _FOR = 0.7, 0.97


class MirroredSensorError(ValueError):
    """The board turns clockwise in one sensor's images when it turns anticlockwise in another's."""


def check(views: Sequence[CornerView]) -> None:
    """Refuses views of which one sensor's are mirrored.

    A chessboard's and a grid's mirror image are a chessboard and a grid, so that one image does not tell. But a board
    that is rolled turns the same way in the images of all sensors that see its print, unless one of them is mirrored.
    If the board was never rolled, nothing is found.

    Raises:
        MirroredSensorError: names both sensors; which of them it is cannot be told.
    """
    rolls: dict[str, dict[int, float]] = {}
    for sensor in dict.fromkeys(view.sensor for view in views):
        seen = [view for view in views if view.sensor == sensor]
        size = extent(seen)
        rolls[sensor] = {view.shot: stance(view, size).roll for view in seen}
    for first, second in combinations(rolls, 2):
        shared = sorted(rolls[first].keys() & rolls[second].keys())
        if len(shared) < LEAST_SHARED:
            continue
        a, b = (np.array([rolls[sensor][shot] for shot in shared]) for sensor in (first, second))
        # Twice the angle, since a board may be counted from either end.
        same, opposite = (abs(np.exp(2j * (a - sign * b)).mean()) for sign in (1, -1))
        if opposite > _FOR and same < _AGAINST:
            raise MirroredSensorError(
                f"{first} or {second} sees the board as in a mirror: it turns clockwise in one's images when it turns "
                "anticlockwise in the other's. Switch off the mirroring of that camera or its driver"
            )
