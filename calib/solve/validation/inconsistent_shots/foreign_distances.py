"""Distances that are not those of the boards: of mirrored or turned depth images, of other moments, in another unit.

How far distances deviate is estimated from what they miss by. So such ones count for nothing: the corners alone place
all sensors, with small residuals, and the distances stay as wrong as they are.
"""

from dataclasses import dataclass

import numpy as np

from calib.board.views import PlaneView
from calib.solve.diagnoses import robust_line
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.start.registration import fit_plane
from calib.solve.validation.distance_errors import DistanceShift, Misread, distance_errors

#: Distances are foreign if they miss the boards by this many times what they miss planes of their own by, and by this
#: share of themselves. Another offset and scale than described are no reason; …
_FAR, _SHARE = 5.0, 0.01

#: … a scale beyond this one is that of another unit.
_GROSS = 0.2


@dataclass(frozen=True)
class ForeignDistances:
    """A depth sensor whose distances are not those of the boards.

    Attributes:
        sensor: its name.
        factor: distances over those of the boards.
        miss, own: medians over the shots of how far distances miss the boards, by the factor, and planes of their own
            [m].
    """

    sensor: str
    factor: float
    miss: float
    own: float

    @property
    def is_far(self) -> bool:
        """True if no factor explains the differences."""
        return self.miss > _FAR * self.own

    @property
    def finding(self) -> str:
        """The finding, without the sensor's name."""
        if self.is_far:
            return (
                f"its distances miss the boards by {rounded(self.miss * 1e3)} mm, and planes of their own by "
                f"{rounded(self.own * 1e3)} mm only"
            )
        return f"its distances are {rounded(self.factor)} times as long as those of the boards"

    @property
    def remedy(self) -> str:
        """Likely causes, and what to do."""
        if self.is_far:
            return (
                "is its depth image mirrored, turned, or of another moment than the image that shows the corners? Take "
                "both as the device makes them"
            )
        return (
            "are they, or the lengths of the board, in another unit? Correct it where they are imported, or in the "
            "description"
        )

    def __str__(self) -> str:
        """The finding, and what to do."""
        return f"{self.sensor}: {self.finding}: {self.remedy}"


#: A mistake in the distances of a sensor.
DistanceError = Misread | DistanceShift | ForeignDistances


def wrong_distances(solution: Solution, needed_px: float) -> list[DistanceError]:
    """Mistakes in distances, at most one of each sensor; `needed_px` as in `distance_errors`."""
    return [*distance_errors(solution, needed_px)] or [*foreign_distances(solution)]


def foreign_distances(solution: Solution) -> list[ForeignDistances]:
    """Depth sensors, exposed with the others, whose distances are not those of the boards."""
    found = []
    for name, sensor in solution.task.sensors.items():
        views = [view for view in solution.task.planes if view.sensor == name and view.shot in solution.boards]
        if views and not sensor.free_running:
            found += _of_sensor(solution, name, views)
    return found


def _of_sensor(solution: Solution, name: str, views: list[PlaneView]) -> list[ForeignDistances]:
    state = solution.state.sensors[name]
    said, own = [], []
    for view in views:
        said.append(state.predicted_distances(state.camera.T_sr @ solution.boards[view.shot], view.pixels))
        normal, height = fit_plane(state.camera, view)
        along = state.camera.directions(view.pixels) @ normal
        own.append(float(np.median(np.abs(view.distances - height / along))))
    medians = [np.array([np.median(each) for each in of]) for of in (said, [view.distances for view in views])]
    factor, offset = robust_line(*medians)
    pairs = zip(views, said, strict=True)
    misses = [np.median(np.abs(view.distances - factor * each - offset)) for view, each in pairs]
    one = ForeignDistances(name, factor, float(np.median(misses)), float(np.median(own)))
    is_foreign = one.is_far and one.miss > _SHARE * float(np.median(medians[1]))
    return [one] if is_foreign or (not one.is_far and abs(factor - 1) > _GROSS) else []
