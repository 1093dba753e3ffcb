"""Lenses of another kind that fit a sensor's corners far better, which is why shots or halves may disagree."""

from dataclasses import replace

import numpy as np

from calib.solve.bundle.parameters.lens_parameters import FISHEYE, RATIONAL
from calib.solve.bundle.tasks import SensorTask
from calib.solve.solution import Solution
from calib.solve.start.board_poses import initial_camera, pose_candidates
from calib.solve.start.start import fit_camera

#: Kinds that describe wide lenses.
_WIDE = (RATIONAL, FISHEYE)

#: Another kind is named if corners miss by this many times less.
_BETTER = 1.5


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
                f"{name}: with a {best} lens, corners of an image miss by {misses[best]:.2g} px, with a "
                f"{sensor.lens.name} one by {given:.2g} px: --lens {name}={best}"
            )
    return found


def _miss(solution: Solution, name: str, sensor: SensorTask) -> float:
    """Median over the views of the root mean square residual [px], with a camera of one kind for them; inf if none."""
    views = [view for view in solution.task.corners if view.sensor == name]
    if not views:
        return np.inf
    try:
        first = initial_camera(sensor.width, sensor.height, sensor.lens, views)
        camera = fit_camera(name, replace(sensor, factory=()), views, first)
    except ValueError:
        return np.inf
    misses = [found[0].rms_px for view in views if (found := pose_candidates(camera, view))]
    return float(np.median(misses)) if misses else np.inf
