"""Two-halves cross-validation: the odd and the even shots calibrated apart, and how far the answers lie apart.

Small residuals prove nothing: a lens that does not fit, a bent board or too few views hide in them. Two halves of the
shots that disagree by more than their own deviations say do prove something (J. Chen, mrcal). Each sensor's projection
is compared without what a small motion of the camera undoes, and each pair of sensors from image to image.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.adjustment import adjust
from calib.solve.bundle.formulation import formulate, groups_of
from calib.solve.bundle.state import State
from calib.solve.bundle.tasks import Task
from calib.solve.solution import Solution
from calib.solve.validation import projection_uncertainty
from calib.solve.validation.support import supported

#: Fewest shots in a half.
LEAST_SHOTS = 4


class TooFewToSplitError(ValueError):
    """Shots of which two halves cannot be calibrated."""


@dataclass(frozen=True)
class Agreement:
    """How the halves agree on one projection.

    Attributes:
        of: "tof", the sensor's own, or "tof → color".
        difference_px: root mean square where boards were seen.
        predicted_px: what it should be by the halves' own covariances.
        pixels, differences: over the image, for pictures (rows, columns, 2) [px] both; NaN where no board was seen.
    """

    of: str
    difference_px: float
    predicted_px: float
    pixels: NDArray[np.float64]
    differences: NDArray[np.float64]

    @property
    def ratio(self) -> float:
        """Difference over prediction."""
        return self.difference_px / max(self.predicted_px, 1e-12)


def cross_validate(solution: Solution, distance: float, note: Callable[[str], None]) -> list[Agreement]:
    """Calibrates the odd and the even shots apart and compares their projections at a distance [m].

    Raises:
        TooFewToSplitError: if a half cannot be calibrated.
    """
    first, second = (_half(solution, shots, note) for shots in _split(solution.task))
    found = [
        _image(solution, first, second, name, distance)
        for name in solution.task.sensors
        if solution.adjustment.layout.freedoms[name].intrinsics
    ]
    depth = {view.sensor for view in solution.task.planes}
    for source, target in permutations(solution.task.sensors, 2):
        # Once for every pair, from the depth sensor if only one of them is one.
        order = list(solution.task.sensors)
        forward = (source in depth, -order.index(source)) > (target in depth, -order.index(target))
        if forward:
            found.append(_pair(solution, first, second, source, target, distance))
    return found


def _split(task: Task) -> tuple[Sequence[int], Sequence[int]]:
    """Every other shot; of a moving board, stretches of it, since neighbours place the board between them."""
    shots = task.shots
    if len(shots) < 2 * LEAST_SHOTS:
        raise TooFewToSplitError(
            f"{len(shots)} shots are too few for two halves; take {2 * LEAST_SHOTS} or more, better 30"
        )
    length = 1
    if any(sensor.runs_free for sensor in task.sensors.values()):
        length = max(3, len(shots) // 8)
    return (
        [shot for index, shot in enumerate(shots) if index // length % 2 == 0],
        [shot for index, shot in enumerate(shots) if index // length % 2 == 1],
    )


def _half(solution: Solution, shots: Sequence[int], note: Callable[[str], None]) -> Solution:
    task = solution.task.of_shots(shots)
    formulation = formulate(task)
    known = solution.boards  # of views that lay between shots there is none; the nearest will do to begin with
    boards = {shot: known[min(known, key=lambda each: abs(each - shot))] for shot in formulation.layout.shots}
    state = State(solution.state.sensors, boards)
    if len(groups_of(task)) < len(groups_of(solution.task)):
        raise TooFewToSplitError("a sensor's views are all in one half of the shots; take more of it")
    note(f"half of the shots: {', '.join(map(str, shots[:6]))} …")
    try:
        found = adjust(formulation, state, len(groups_of(task)), lambda _: None)
    except ValueError as error:
        raise TooFewToSplitError(f"half of the shots alone cannot be calibrated: {error}") from error
    return Solution(task, found)


def _image(solution: Solution, first: Solution, second: Solution, name: str, distance: float) -> Agreement:
    camera = solution.cameras[name]
    layout = solution.adjustment.layout
    changes = projection_uncertainty.implied_changes(solution, name, distance)
    columns = layout.columns(name, layout.freedoms[name].intrinsics)
    pixels = projection_uncertainty.grid(camera)
    inside = supported(solution, name, pixels.reshape(-1, 2))
    differences = changes @ (_intrinsics(first, name) - _intrinsics(second, name))
    return _agreement(name, pixels, differences, changes, columns, (first, second), inside)


def _intrinsics(half: Solution, name: str) -> NDArray[np.float64]:
    wanted = [f"{name}.{each}" for each in half.adjustment.layout.freedoms[name].intrinsics]
    values = {parameter.name: parameter.value for parameter in half.parameters}
    return np.array([values[each] for each in wanted])


def _pair(
    solution: Solution, first: Solution, second: Solution, source: str, target: str, distance: float
) -> Agreement:
    layout = solution.adjustment.layout
    changes = projection_uncertainty.pair_changes(solution.state, layout, source, target, distance)
    columns = projection_uncertainty.pair_columns(layout, source, target)
    pixels = projection_uncertainty.grid(solution.cameras[source])
    flat = pixels.reshape(-1, 2)
    ends = [projection_uncertainty.mapped(half.state, source, target, flat, distance) for half in (first, second)]
    inside = projection_uncertainty.pair_support(solution, source, target, distance).ravel()
    return _agreement(f"{source} → {target}", pixels, ends[0] - ends[1], changes, columns, (first, second), inside)


def _agreement(
    of: str,
    pixels: NDArray[np.float64],
    differences: NDArray[np.float64],
    changes: NDArray[np.float64],
    columns: NDArray[np.intp],
    halves: tuple[Solution, Solution],
    inside: NDArray[np.bool_],
) -> Agreement:
    covariance = sum((half.covariance[np.ix_(columns, columns)] for half in halves), np.zeros((columns.size,) * 2))
    expected = projection_uncertainty.total_spread(changes, covariance)
    lengths = np.linalg.norm(differences, axis=1)
    both = inside & np.isfinite(lengths) & np.isfinite(expected)
    return Agreement(
        of,
        projection_uncertainty.rms(lengths[both]),
        projection_uncertainty.rms(expected[both]),
        pixels,
        np.where(both[:, None], differences, np.nan).reshape(pixels.shape),
    )
