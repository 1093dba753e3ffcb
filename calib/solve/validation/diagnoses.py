"""What usually goes wrong with a calibration, recognised before a number is believed, each with its own message."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.solve.bundle.layout import DEPTH_TERMS
from calib.solve.bundle.state import State
from calib.solve.bundle.tasks import Task
from calib.solve.solution import Parameter
from calib.solve.start.board_poses import sightings
from calib.solve.start.registration import plane
from calib.solve.start.start import alone
from calib.views import CornerView

#: Fewest views of a sensor whose intrinsics are free.
LEAST_VIEWS = 6

#: A board whose squares are this much larger or smaller than said is noticed.
SCALE_TOLERANCE = 0.02

#: Views explained this many times better by another sensor's camera are another sensor's views.
BETTER = 3.0

#: What kept intrinsics miss corners by at most, over what fitted ones do, and if it is more than so many pixels of an
#: image of 1000 pixels across.
FACTORY_RATIO = 4.0
FACTORY_MISS = 0.5


class ViewsError(ValueError):
    """Views of which no calibration can be made: too few."""


class SquareSizeError(ValueError):
    """A board whose squares are not of the size that was said; `scale` is true size over said."""

    def __init__(self, message: str, scale: float) -> None:
        self.scale = scale
        super().__init__(message)


class MixedUpError(ValueError):
    """Views or cameras under the wrong sensor's name."""


def require_views(task: Task) -> None:
    """Every sensor has enough views.

    Raises:
        ViewsError: one has too few.
    """
    for name, sensor in task.sensors.items():
        corners = sum(view.sensor == name for view in task.corners)
        planes = sum(view.sensor == name for view in task.planes)
        least = task.least_kept if sensor.keeps_intrinsics else LEAST_VIEWS
        count = max(corners, planes) if sensor.keeps_intrinsics else corners
        if count < least:
            why = "to be placed in the rig" if sensor.keeps_intrinsics else "to find its intrinsics"
            raise ViewsError(f"{name}: {count} views of the board; at least {least} are needed {why}, better 30")


def require_own_names(task: Task) -> None:
    """All views and cameras are under the name of their own sensor.

    Raises:
        MixedUpError: views lie outside their sensor's image, or fit another camera better, or not the one to keep.
    """
    for view in task.corners:
        sensor = task.sensors[view.sensor]
        if np.any(view.pixels < -0.5) or np.any(view.pixels > (sensor.width - 0.5, sensor.height - 0.5)):
            fits = [name for name, other in task.sensors.items() if name != view.sensor and _fits(view, other.width)]
            hint = f"; they would fit {' or '.join(fits)}: are the names mixed up?" if fits else ""
            raise MixedUpError(
                f"{view.sensor}, shot {view.shot}: corners at up to {view.pixels.max(axis=0).round().tolist()} do not "
                f"lie in an image of {sensor.width} × {sensor.height} pixels{hint}"
            )
    factory = {name: sensor.factory[0] for name, sensor in task.sensors.items() if sensor.factory}
    for a, b in combinations(factory, 2):
        _require_not_swapped(a, b, factory, task)
    for name, camera in factory.items():
        _require_factory_fits(name, camera, task)


def _fits(view: CornerView, width: int) -> bool:
    return bool(view.pixels[:, 0].max() < width)


def _require_not_swapped(a: str, b: str, factory: Mapping[str, Camera], task: Task) -> None:
    if (factory[a].width, factory[a].height) != (factory[b].width, factory[b].height):
        return
    own = [_miss(factory[name], name, task) for name in (a, b)]
    other = [_miss(factory[b], a, task), _miss(factory[a], b, task)]
    if all(np.isfinite([*own, *other])) and all(BETTER * y < x for x, y in zip(own, other, strict=True)):
        raise MixedUpError(
            f"{a} and {b} are mixed up: with each other's given intrinsics the corners miss by {other[0]:.2g} and "
            f"{other[1]:.2g} px, with their own by {own[0]:.2g} and {own[1]:.2g} px; exchange their names"
        )


def _require_factory_fits(name: str, camera: Camera, task: Task) -> None:
    """Compares kept intrinsics with those that the same views would ask for."""
    views = [view for view in task.corners if view.sensor == name]
    if not task.sensors[name].keeps_intrinsics or len(views) < LEAST_VIEWS:
        return
    given, own = _miss(camera, name, task), _miss(alone(name, task.sensors[name], views, camera), name, task)
    if given > FACTORY_RATIO * own and given > FACTORY_MISS * camera.width / 1000:
        raise MixedUpError(
            f"{name}: with the given intrinsics the corners miss by {given:.2g} px, with intrinsics of their own by "
            f"{own:.2g} px; the given ones are of another sensor, of another mode of it, or no longer right: check the "
            "name, or do not keep them"
        )


def _miss(camera: Camera, name: str, task: Task) -> float:
    """Median over a sensor's views of the corners' root mean square miss [px]; NaN if it has none."""
    views = [view for view in task.corners if view.sensor == name][:20]
    misses = [found[0].rms_px for view in views if (found := sightings(camera, view))]
    return float(np.median(misses)) if misses else float("nan")


def suspect_square_size(task: Task, state: State) -> bool:
    """Whether all depth sensors seem to measure boards that are larger or smaller than said.

    All that corners say of distances grows with the size of the squares, what a depth sensor says does not. A constant
    offset of its distances is allowed for where the boards' distances differ enough to tell it from a factor. From the
    first guess of the cameras this is a suspicion only; `require_square_size` decides.

    Args:
        task: its depth sensors.
        state: cameras and boards from corners alone.
    """
    scales = [scale for name in task.sensors if (scale := _scale(name, task, state)) is not None]
    return bool(scales) and all(abs(scale - 1) > SCALE_TOLERANCE for scale in scales)


def with_free_scales(task: Task) -> Task:
    """The task with offset and scale of all distances free."""
    depth = {view.sensor for view in task.planes}
    sensors = {
        name: replace(sensor, depth_terms=DEPTH_TERMS) if name in depth else sensor
        for name, sensor in task.sensors.items()
    }
    return replace(task, sensors=sensors)


def require_square_size(parameters: Sequence[Parameter]) -> None:
    """Judges the scales of a solution in which they were free.

    Raises:
        SquareSizeError: the depth sensors agree that the squares are of another size.
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
        "as large as its description says: measure them with a ruler, and print without scaling to fit the page",
        scale,
    )


def _scale(name: str, task: Task, state: State) -> float | None:
    """Factor between distances measured and those that corners say; None if a sensor cannot tell 2 %."""
    camera = state.sensors[name].camera
    views = [view for view in task.planes if view.sensor == name and view.shot in state.boards]
    own = {view.shot for view in task.corners if view.sensor == name}
    views = [view for view in views if view.shot in own]
    if len(views) < LEAST_VIEWS:
        return None
    said, measured = np.empty(len(views)), np.empty(len(views))
    for index, view in enumerate(views):
        board = camera.T_sr @ state.boards[view.shot]
        said[index] = board[:3, 2] @ board[:3, 3]
        measured[index] = plane(camera, view)[1]
    return _factor(said, measured)


def _factor(said: NDArray[np.float64], measured: NDArray[np.float64]) -> float | None:
    """Slope of measured over said distances, with an offset if they spread enough to tell the two apart."""
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
    return float(found[0])
