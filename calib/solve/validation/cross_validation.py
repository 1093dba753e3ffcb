"""Two-fold cross-validation: calibrations from every other pose of the board, and their difference.

Small residuals are no evidence: a wrong lens model, a bent board or too few views do not show in them. Two halves of
the shots that differ by more than noise predicts are evidence (J. Chen, mrcal). Shots that repeat a pose of the
board stay in one half, as they share its errors. Each sensor's projection is compared up to a small motion of the
camera, and each pair of sensors from image to image.
"""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.adjustment import adjust
from calib.solve.bundle.formulation import formulate, groups_of
from calib.solve.bundle.parameters.state import State
from calib.solve.bundle.tasks import Task
from calib.solve.solution import Solution
from calib.solve.validation import projection_uncertainty
from calib.solve.validation.support import supported

#: Minimum number of distinct poses in a half.
MIN_POSES = 4


class TooFewToSplitError(ValueError):
    """Shots that cannot be split into two solvable halves."""


@dataclass(frozen=True)
class Agreement:
    """Difference between the halves in one projection.

    Attributes:
        of: "tof" for a sensor alone, "tof → color" for a pair.
        difference_px: root mean square where boards were seen.
        predicted_px: expected value if noise were the only error.
        pixels, differences: over the image, for plots (rows, columns, 2) [px] both; NaN where no board was seen.
    """

    of: str
    difference_px: float
    predicted_px: float
    pixels: NDArray[np.float64]
    differences: NDArray[np.float64]

    @property
    def ratio(self) -> float:
        """Observed over predicted difference."""
        return self.difference_px / max(self.predicted_px, 1e-12)


def cross_validate(
    solution: Solution, distance: float, note: Callable[[str], None], half: Set[int] = frozenset()
) -> list[Agreement]:
    """Calibrates halves of the shots separately and compares their projections at a distance [m].

    Args:
        solution: from all shots.
        distance: at which projections are compared [m].
        note: called with progress messages.
        half: shots of the one half; every other pose if empty.

    Raises:
        TooFewToSplitError: a half cannot be calibrated, or is not independent of the other one.
    """
    split = _chosen(solution.task, half) if half else _split(solution.task)
    first, second = (_half(solution, shots, note) for shots in split)
    found = [
        _image(solution, first, second, name, distance)
        for name in solution.task.sensors
        if solution.adjustment.layout.free_parameters[name].intrinsics
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
    """Shots of alternating poses."""
    of_shots = _runs(task) if any(sensor.free_running for sensor in task.sensors.values()) else task.poses
    poses = list(dict.fromkeys(of_shots[shot] for shot in task.shots))
    if len(poses) < 2 * MIN_POSES:
        raise TooFewToSplitError(
            f"{len(poses)} distinct poses of the board are too few for two halves; show {2 * MIN_POSES} or more, "
            "better 30"
        )
    first = set(poses[::2])
    return (
        [shot for shot in task.shots if of_shots[shot] in first],
        [shot for shot in task.shots if of_shots[shot] not in first],
    )


def _chosen(task: Task, half: Set[int]) -> tuple[Sequence[int], Sequence[int]]:
    """Shots of a half, and the others. A pose in both would have them agree about its errors."""
    halves = [shot for shot in task.shots if shot in half], [shot for shot in task.shots if shot not in half]
    first, second = ({task.poses[shot]: shot for shot in shots} for shots in halves)
    if both := first.keys() & second.keys():
        one = min(both)
        raise TooFewToSplitError(
            f"shots {first[one]} and {second[one]} show one pose of the board, which has to be in one half"
        )
    if min(len(first), len(second)) < MIN_POSES:
        raise TooFewToSplitError(f"{len(first)} and {len(second)} distinct poses; each half needs {MIN_POSES} or more")
    return halves


def _runs(task: Task) -> Mapping[int, int]:
    """Runs of consecutive shots, by shot, that end where the pose changes: poses of a moving board are interpolated."""
    shots = task.shots
    length, runs, began = max(3, len(shots) // 8), dict[int, int](), 0
    for index, shot in enumerate(shots):
        if index and task.poses[shot] != task.poses[shots[index - 1]] and index - began >= length:
            began = index
        runs[shot] = began
    return runs


def _half(solution: Solution, shots: Sequence[int], note: Callable[[str], None]) -> Solution:
    task = solution.task.of_shots(shots)
    formulation = formulate(task)
    known = solution.boards  # interpolated views have no pose of their own; the nearest is a sufficient start
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
    changes = projection_uncertainty.implied_jacobian(solution, name, distance)
    columns = layout.columns(name, layout.free_parameters[name].intrinsics)
    pixels = projection_uncertainty.grid(camera)
    inside = supported(solution, name, pixels.reshape(-1, 2))
    differences = changes @ (_intrinsics(first, name) - _intrinsics(second, name))
    return _agreement(name, pixels, differences, changes, columns, (first, second), inside)


def _intrinsics(half: Solution, name: str) -> NDArray[np.float64]:
    wanted = [f"{name}.{each}" for each in half.adjustment.layout.free_parameters[name].intrinsics]
    values = {parameter.name: parameter.value for parameter in half.parameters}
    return np.array([values[each] for each in wanted])


def _pair(
    solution: Solution, first: Solution, second: Solution, source: str, target: str, distance: float
) -> Agreement:
    layout = solution.adjustment.layout
    changes = projection_uncertainty.pair_jacobian(solution.state, layout, source, target, distance)
    columns = projection_uncertainty.pair_columns(layout, source, target)
    pixels = projection_uncertainty.grid(solution.cameras[source])
    flat = pixels.reshape(-1, 2)
    ends = [projection_uncertainty.map_pixels(half.state, source, target, flat, distance) for half in (first, second)]
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
    covariance = sum(
        (half.adjustment.noise[np.ix_(columns, columns)] for half in halves), np.zeros((columns.size,) * 2)
    )
    expected = projection_uncertainty.total_deviation(changes, covariance)
    lengths = np.linalg.norm(differences, axis=1)
    both = inside & np.isfinite(lengths) & np.isfinite(expected)
    return Agreement(
        of,
        projection_uncertainty.rms(lengths[both]),
        projection_uncertainty.rms(expected[both]),
        pixels,
        np.where(both[:, None], differences, np.nan).reshape(pixels.shape),
    )
