"""Lenses that do not fit: of another kind, which is why shots or halves may disagree, or of none that is known."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.parameters.lens_parameters import FISHEYE, RATIONAL
from calib.solve.bundle.tasks import SensorTask
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.start.board_poses import initial_camera, pose_candidates
from calib.solve.start.start import fit_unknown

#: Kinds that describe wide lenses.
_WIDE = (RATIONAL, FISHEYE)

#: Another kind is named if corners miss by this many times less.
_BETTER = 1.5

#: Cells across the image, and distinct poses in one, from which on it says what corners miss by there in all shots.
_CELLS, _POSES = 16, 4

#: Share of the required accuracy that a lens may leave, as a root mean square: 95 % are then below half of it. Of real
#: sensors, those whose lens fits leave 0.05 px at most.
_HARMLESS = 0.29


def other_lenses(solution: Solution) -> list[str]:
    """Likely causes of a calibration that is not trusted, each with what to do; none of sensors whose lens is kept."""
    found = []
    for name, sensor in solution.task.sensors.items():
        if sensor.fixed_intrinsics or sensor.fixed:
            continue
        misses = {kind.name: _miss(solution, name, replace(sensor, lens=kind)) for kind in (sensor.lens, *_WIDE)}
        given, best = misses[sensor.lens.name], min(misses, key=lambda kind: misses[kind])
        if given > _BETTER * misses[best]:
            found.append(
                f"{name}: with a {best} lens, corners of an image miss by {rounded(misses[best])} px, with a "
                f"{sensor.lens.name} one by {rounded(given)} px: --lens {name}={best}"
            )
    return found


def _miss(solution: Solution, name: str, sensor: SensorTask) -> float:
    """Median over the views of the root mean square residual [px], with a camera of one kind for them; inf if none."""
    views = [view for view in solution.task.corners if view.sensor == name]
    if not views:
        return np.inf
    try:
        first = initial_camera(sensor.width, sensor.height, sensor.lens, views)
        camera = fit_unknown(name, replace(sensor, factory=()), views, first)
    except ValueError:
        return np.inf
    misses = [found[0].rms_px for view in views if (found := pose_candidates(camera, view))]
    return float(np.median(misses)) if misses else np.inf


def undescribed(solution: Solution, needed_px: float) -> list[str]:
    """Doubts about sensors whose corners miss alike, in all shots, where they are in the same place of the image.

    Neither deviations nor halves show it, as all shots have it in common.

    Args:
        solution: the calibration.
        needed_px: required accuracy of projections, 95 % of the time [px].
    """
    found = []
    for name in solution.task.sensors:
        miss = _common_miss(solution, name)
        if miss > _HARMLESS * needed_px:
            found.append(
                f"{name}: corners miss by {rounded(miss)} px in the same places of the image in all shots, which a "
                f"{solution.task.sensors[name].lens.name} lens does not describe: try another kind of lens, and take "
                "away what is in front of it, such as a window; images must be neither rectified nor stabilised"
            )
    return found


def _common_miss(solution: Solution, name: str) -> float:
    """Root mean square over the cells of an image of the mean by which corners miss there [px], less its chance."""
    cells: dict[tuple[int, int], dict[int, list[NDArray[np.float64]]]] = {}
    size = solution.task.sensors[name].width / _CELLS
    for view in solution.views:
        if view.sensor == name and view.of == "corners":
            for place, miss in zip(view.pixels[~view.outliers], view.residuals[~view.outliers], strict=True):
                cell = cells.setdefault((int(place[0] // size), int(place[1] // size)), {})
                cell.setdefault(solution.task.poses[view.shot], []).append(miss)
    squares = []
    for by_pose in cells.values():
        means = np.array([np.mean(misses, axis=0) for misses in by_pose.values()])
        if len(means) >= _POSES:
            chance = float(means.var(axis=0, ddof=1).sum()) / len(means)
            squares.append(float(np.sum(means.mean(axis=0) ** 2)) - chance)
    return float(np.sqrt(max(np.mean(squares), 0.0))) if squares else 0.0
