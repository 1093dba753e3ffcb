"""Kept intrinsics against the images of the solve that took them as given."""

import math
from dataclasses import replace

import numpy as np

from calib.calibration_check.optics import QUANTILE, optics_change
from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.bundle.parameters.lens_parameters import MATRIX
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.validation.inconsistent_shots.steadiness import HARMLESS
from calib.solve.validation.verdict import Assessment


def with_kept(assessment: Assessment, solution: Solution, needed_px: float) -> Assessment:
    """An assessment that also doubts kept intrinsics which the sensor's own corners contradict.

    Args:
        assessment: of the solution, which takes them as given.
        solution: with some intrinsics fixed, or none.
        needed_px: required accuracy of projections; another focal length or principal point is harmless if it shifts
            the corners by less than half of that beyond what noise may do [px].
    """
    kept = [name for name, sensor in solution.task.sensors.items() if sensor.fixed_intrinsics]
    wrong = [text for name in kept if (text := _contradicted(solution, name, needed_px))]
    if not wrong:
        return assessment
    reasons = [*assessment.reasons, *wrong]
    return replace(assessment, trusted=False, reasons=reasons, verdict=f"Do not trust it yet: {reasons[0]}")


def _contradicted(solution: Solution, sensor: str, needed_px: float) -> str:
    own = [view for view in solution.task.corners if view.sensor == sensor]
    if not own:
        return ""
    names = tuple(f"{sensor}.{name}" for name in MATRIX)
    exact = Stored({sensor: solution.state.sensors[sensor]}, names, np.zeros((len(names), len(names))))
    try:
        change = optics_change(exact, Views(own, ()), sensor)
    except NotSolvedError:  # its residuals say so
        return ""
    if change is None or not change.is_significant:
        return ""
    certain = 1 - math.sqrt(QUANTILE / change.squared)  # the part that is no noise
    if change.shift_px * certain < HARMLESS * needed_px:
        return ""
    focal, across, down = change.values.tolist()
    return (
        f"{sensor}: its images contradict the intrinsics that are kept: they have a focal length {focal:+.1%} ± "
        f"{change.sigmas[0]:.1%} and a principal point ({across:+.1f}, {down:+.1f}) px from these, which shifts its "
        f"corners by {rounded(change.shift_px)} px: do not keep them, or look for another mode, zoom or focus"
    )
