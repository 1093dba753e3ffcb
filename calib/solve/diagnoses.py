"""Detection of common calibration mistakes, each with its own message."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, groupby

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.views import CornerView
from calib.camera import Camera
from calib.solve.bundle.parameters.layout import DEPTH_TERMS
from calib.solve.bundle.parameters.state import State
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.rounding import rounded
from calib.solve.solution import Parameter
from calib.solve.start.board_poses import pose_candidates
from calib.solve.start.registration import fit_plane
from calib.solve.start.start import fit_camera

#: Minimum number of distinct poses of the board before a sensor with free intrinsics.
MIN_VIEWS = 6

#: Relative error of the square size that is reported.
SCALE_TOLERANCE = 0.02

#: Views that another sensor's camera explains this many times better belong to that sensor.
BETTER = 3.0

#: Fixed intrinsics are rejected if their reprojection error is larger than this ratio to that of fitted ones, and
#: larger than this many pixels in an image of 1000 pixels across.
FACTORY_RATIO = 4.0
FACTORY_MISS = 0.5


#: Views of the initial state that miss by this many times their sensor's median, and by this much [px], are named.
FAR_RATIO, FAR_PX = 10.0, 10.0


class ViewsError(ValueError):
    """Too few views for a calibration."""


class SquareSizeError(ValueError):
    """Square size different from the board's description; `scale` is true over described size."""

    def __init__(self, message: str, scale: float) -> None:
        self.scale = scale
        super().__init__(message)


class MixedUpError(ValueError):
    """Views or cameras assigned to the wrong sensor."""


def require_views(task: Task) -> None:
    """Checks that every sensor saw enough distinct poses of the board.

    Raises:
        ViewsError: a sensor saw too few.
    """
    for name, sensor in task.sensors.items():
        corners = [view.shot for view in task.corners if view.sensor == name]
        planes = [view.shot for view in task.planes if view.sensor == name]
        shots = planes if sensor.fixed_intrinsics and len(planes) > len(corners) else corners
        minimum = task.min_views_fixed if sensor.fixed_intrinsics else MIN_VIEWS
        count = len({task.poses[shot] for shot in shots})
        if count < minimum:
            why = "to be placed in the rig" if sensor.fixed_intrinsics else "to find its intrinsics"
            plural = "s" * (count != 1)
            raise ViewsError(
                f"{name}: {len(shots)} views of {count} distinct pose{plural} of the board; at least {minimum} poses "
                f"are needed {why}, better 30"
            )


def require_matching_sensors(task: Task) -> None:
    """Checks that views and cameras are assigned to the right sensor.

    Raises:
        MixedUpError: views outside their sensor's image, better explained by another camera, or not by the fixed one.
    """
    for view in task.corners:
        sensor = task.sensors[view.sensor]
        outside = view.pixels[_is_outside(view, sensor)]
        if len(outside):
            fits = [name for name, other in task.sensors.items() if not _is_outside(view, other).any()]
            hint = f"; they would fit {' or '.join(fits)}: are the names mixed up?" if fits else ""
            raise MixedUpError(
                f"{view.sensor}, shot {view.shot}: a corner at {outside[0].round(1).tolist()} does not lie in an image "
                f"of {sensor.width} × {sensor.height} pixels{hint}"
            )
    factory = {name: sensor.factory[0] for name, sensor in task.sensors.items() if sensor.factory}
    for a, b in combinations(factory, 2):
        _require_not_swapped(a, b, factory, task)
    for name, camera in factory.items():
        _require_factory_fits(name, camera, task)


def _is_outside(view: CornerView, sensor: SensorTask) -> NDArray[np.bool_]:
    """Corners (n,) that do not lie in the image of a sensor."""
    return np.any((view.pixels < -0.5) | (view.pixels > np.array([sensor.width, sensor.height]) - 0.5), axis=1)


def _require_not_swapped(a: str, b: str, factory: Mapping[str, Camera], task: Task) -> None:
    if (factory[a].width, factory[a].height) != (factory[b].width, factory[b].height):
        return
    own = [_miss(factory[name], name, task) for name in (a, b)]
    other = [_miss(factory[b], a, task), _miss(factory[a], b, task)]
    if all(np.isfinite([*own, *other])) and all(BETTER * y < x for x, y in zip(own, other, strict=True)):
        raise MixedUpError(
            f"{a} and {b} are mixed up: with each other's given intrinsics the corners miss by {rounded(other[0])} and "
            f"{rounded(other[1])} px, with their own by {rounded(own[0])} and {rounded(own[1])} px; "
            "exchange their names"
        )


def _require_factory_fits(name: str, camera: Camera, task: Task) -> None:
    """Compares the reprojection error of fixed intrinsics with that of fitted ones."""
    views = [view for view in task.corners if view.sensor == name]
    if not task.sensors[name].fixed_intrinsics or len(views) < MIN_VIEWS:
        return
    given, own = _miss(camera, name, task), _miss(fit_camera(name, task.sensors[name], views, camera), name, task)
    if given > FACTORY_RATIO * own and given > FACTORY_MISS * camera.width / 1000:
        raise MixedUpError(
            f"{name}: with the given intrinsics the corners miss by {rounded(given)} px, with intrinsics of their own "
            f"by {rounded(own)} px; the given ones are of another sensor, of another mode of it, or no longer right: "
            "check the name, or do not keep them"
        )


def _miss(camera: Camera, name: str, task: Task) -> float:
    """Median root mean square reprojection error over a sensor's views [px]; NaN without views."""
    views = [view for view in task.corners if view.sensor == name][:20]
    misses = [found[0].rms_px for view in views if (found := pose_candidates(camera, view))]
    return float(np.median(misses)) if misses else float("nan")


def unlike_the_rest(task: Task, state: State) -> str:
    """Shots that even the initial state explains far worse than the others, as the end of a sentence; "" if none."""
    misses: dict[str, dict[int, float]] = {}
    for view in task.corners:
        camera, T_rb = state.sensors[view.sensor].camera, state.boards[view.shot]
        errors = np.hypot(*(camera.project(pose.transform(T_rb, view.points_b)) - view.pixels).T)
        misses.setdefault(view.sensor, {})[view.shot] = float(np.median(np.nan_to_num(errors, nan=np.inf)))
    typical = {sensor: float(np.median([*by_shot.values()])) for sensor, by_shot in misses.items()}
    far: dict[int, tuple[float, str]] = {}
    for sensor, by_shot in misses.items():
        for shot, miss in by_shot.items():
            if miss > max(FAR_RATIO * typical[sensor], FAR_PX):
                far[shot] = max(far.get(shot, (0.0, "")), (miss, sensor))
    runs = [list(shots) for is_far, shots in groupby(task.shots, key=far.__contains__) if is_far]
    if not runs:
        return ""
    said = "; ".join(_missing(run, task.shots, far, typical) for run in runs)
    gaps = groupby(enumerate(sorted(far)), key=lambda item: item[1] - item[0])  # where there may be no shot to skip
    parts = [[shot for _, shot in part] for _, part in gaps]
    numbers = ",".join(f"{part[0]}-{part[-1]}" if len(part) > 1 else f"{part[0]}" for part in parts)
    return f". Corners miss in {said}: leave out what is wrong, --skip {numbers}"


def _missing(
    run: Sequence[int], shots: Sequence[int], far: Mapping[int, tuple[float, str]], typical: Mapping[str, float]
) -> str:
    """Clause on shots in a row, by how much they miss; first or last ones may be of another time of the rig."""
    sensors = dict.fromkeys(far[shot][1] for shot in run)
    numbers = f"shots {run[0]} to {run[-1]}" if len(run) > 1 else f"shot {run[0]}"
    miss, median = float(np.median([far[shot][0] for shot in run])), max(typical[name] for name in sensors)
    said = f"{numbers} of {' and '.join(sensors)} by {rounded(miss)} px, {rounded(median)} px are typical"
    if len(run) < MIN_VIEWS or (run[0] > shots[0]) == (run[-1] < shots[-1]):
        return said
    moment = f"before shot {run[0]}" if run[0] > shots[0] else f"after shot {run[-1]}"
    return f"{said} (was a sensor moved {moment}?)"


def suspect_square_size(task: Task, state: State) -> bool:
    """True if all depth sensors measure boards that are larger or smaller than described.

    Distances derived from corners scale with the square size, those of a depth sensor do not. An offset of the
    distances is estimated as well if they vary enough. At the initial state this is only a suspicion;
    `require_square_size` decides.
    """
    scales = [scale for name in task.sensors if (scale := _scale(name, task, state)) is not None]
    return bool(scales) and all(abs(scale - 1) > SCALE_TOLERANCE for scale in scales)


def with_free_scales(task: Task) -> Task:
    """Task with free offset and scale of all distances."""
    depth = {view.sensor for view in task.planes}
    sensors = {
        name: replace(sensor, depth_terms=DEPTH_TERMS) if name in depth else sensor
        for name, sensor in task.sensors.items()
    }
    return replace(task, sensors=sensors)


def require_square_size(parameters: Sequence[Parameter]) -> None:
    """Checks the depth scales of a solution in which they were free.

    Raises:
        SquareSizeError: the depth sensors agree on another square size.
    """
    scales = [each for each in parameters if each.name.endswith(".depth_scale")]
    if not all(abs(each.value) > max(SCALE_TOLERANCE, 4 * each.sigma) for each in scales):
        return
    if np.ptp([each.value for each in scales]) > SCALE_TOLERANCE:
        return
    scale = 1 + float(np.mean([each.value for each in scales]))
    said = " and ".join(f"{each.name.partition('.')[0]} by {each.value:+.1%}" for each in scales)
    raise SquareSizeError(
        f"measured distances differ from the board's apparent size: {said}. Its squares are probably {scale:.3f} times "
        "as large as its description says, or the distances have another unit: measure the squares with a ruler, and "
        "print without scaling to fit the page",
        scale,
    )


def _scale(name: str, task: Task, state: State) -> float | None:
    """Ratio of measured distances to those derived from corners; None for a sensor with too few views."""
    camera = state.sensors[name].camera
    views = [view for view in task.planes if view.sensor == name and view.shot in state.boards]
    own = {view.shot for view in task.corners if view.sensor == name}
    views = [view for view in views if view.shot in own]
    if len({task.poses[view.shot] for view in views}) < MIN_VIEWS:
        return None
    said, measured = np.empty(len(views)), np.empty(len(views))
    for index, view in enumerate(views):
        board = camera.T_sr @ state.boards[view.shot]
        said[index] = board[:3, 2] @ board[:3, 3]
        measured[index] = fit_plane(camera, view)[1]
    return robust_line(said, measured)[0]


def robust_line(said: NDArray[np.float64], measured: NDArray[np.float64]) -> tuple[float, float]:
    """Slope of measured over described distances (n,), and offset if their range suffices, otherwise 0."""
    spread = float(np.ptp(said) / np.median(said))
    terms = np.stack([said, np.ones_like(said)], axis=1)
    if spread < 0.3:
        terms = terms[:, :1]
    weights = np.ones_like(said)
    found = np.zeros(terms.shape[1])
    for _ in range(10):
        found = np.linalg.lstsq(terms * weights[:, None], measured * weights, rcond=None)[0]
        misses = np.abs(measured - terms @ found)
        weights = 1 / np.sqrt(1 + (misses / (2 * np.median(misses) + 1e-9)) ** 2)
    return float(found[0]), float(found[1:].sum())
