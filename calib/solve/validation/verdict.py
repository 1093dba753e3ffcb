"""Verdict on a calibration, in words."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.solve.solution import Solution
from calib.solve.validation import projection_uncertainty
from calib.solve.validation.cross_validation import Agreement, TooFewToSplitError, cross_validate
from calib.solve.validation.projection_uncertainty import UncertaintyMap
from calib.solve.validation.weak_directions import weak_directions

#: Largest ratio of observed to predicted difference of the halves; exceeded by chance in about 1 % of the cases.
MAX_RATIO = 2.0

#: Radius of the 95 % confidence circle in two dimensions, in deviations.
RADIUS_95 = 2.45

#: Differences of the halves below this share of the required accuracy are harmless.
HARMLESS = 0.25

#: Largest fraction of outliers.
MAX_OUTLIERS = 0.1


@dataclass(frozen=True)
class Assessment:
    """Assessment of a solution.

    Attributes:
        trusted: True if the solution is fit for use.
        verdict: one line that begins with "Trust it" or "Do not trust it yet".
        reasons: objections, each with a remedy; empty if trusted.
        agreements: of the two halves; empty with too few shots.
        images: uncertainty of each sensor's projection, by name.
        pairs: uncertainty of each depth sensor's points in the other images, by "tof → color".
        distance: of the scene [m].
    """

    trusted: bool
    verdict: str
    reasons: Sequence[str]
    agreements: Sequence[Agreement]
    images: dict[str, UncertaintyMap]
    pairs: dict[str, UncertaintyMap]
    distance: float


def assess(
    solution: Solution, distance: float, needed_px: float, note: Callable[[str], None] = lambda _: None
) -> Assessment:
    """Cross-validates and judges a solution.

    Args:
        solution: from all shots.
        distance: of the scene [m].
        needed_px: required accuracy of projections, 95 % of the time [px].
        note: called with progress messages.
    """
    images = {
        name: projection_uncertainty.image_uncertainty(solution, name, distance) for name in solution.task.sensors
    }
    pairs = {
        f"{source} → {target}": projection_uncertainty.pair_uncertainty(solution, source, target, distance)
        for source in dict.fromkeys(view.sensor for view in solution.task.planes)
        for target in solution.task.sensors
        if target != source
    }
    reasons = [*weak_directions(solution, distance), *_outliers(solution), *_uncertain({**images, **pairs}, needed_px)]
    try:
        agreements = cross_validate(solution, distance, note)
        reasons += _disagreeing(agreements, needed_px)
    except TooFewToSplitError as error:
        agreements = []
        reasons.append(f"two halves could not be compared: {error}")
    verdict = f"Do not trust it yet: {reasons[0]}" if reasons else _praise(agreements, {**images, **pairs}, distance)
    return Assessment(not reasons, verdict, reasons, agreements, images, pairs, distance)


def _praise(agreements: Sequence[Agreement], fields: dict[str, UncertaintyMap], distance: float) -> str:
    known = max((field.rms * RADIUS_95 for field in fields.values() if not np.isnan(field.rms)), default=0)
    text = f"Trust it: projections at {distance:.2g} m are known to {known:.2g} px (95 %)"
    if agreements:
        worst = max(agreements, key=lambda each: each.ratio)
        text += (
            f", and the halves of the shots differ by {worst.difference_px:.2g} px where "
            f"{worst.predicted_px:.2g} px were predicted ({worst.of}, the worst)"
        )
    return text + "."


def _disagreeing(agreements: Sequence[Agreement], needed_px: float) -> list[str]:
    bad = [each for each in agreements if each.ratio > MAX_RATIO and each.difference_px > HARMLESS * needed_px]
    return [
        f"{each.of}: the halves of the shots differ by {each.difference_px:.2g} px where {each.predicted_px:.2g} px "
        "were predicted; the kind of lens does not fit, the board is not flat, or something moved: take more tilted "
        "views, and try another kind of lens"
        for each in sorted(bad, key=lambda each: -each.ratio)
    ]


def _uncertain(fields: dict[str, UncertaintyMap], needed_px: float) -> list[str]:
    found = []
    for of, field in fields.items():
        known = field.rms * RADIUS_95
        if known > needed_px:
            found.append(
                f"{of}: projections are known to {known:.2g} px only (95 %) where {needed_px:.2g} px are needed; take "
                "more tilted views, and fill the corners of the image"
            )
        if np.isnan(known):
            found.append(f"{of}: nothing that the one sees at this distance is near the image of the other")
    return found


def _outliers(solution: Solution) -> list[str]:
    """Groups with too many outliers."""
    found = []
    for sensor, of in dict.fromkeys((view.sensor, view.of) for view in solution.views):
        views = [view for view in solution.views if (view.sensor, view.of) == (sensor, of)]
        far = sum(int(view.outliers.sum()) for view in views)
        every = sum(len(view.outliers) for view in views)
        if far > MAX_OUTLIERS * every:
            worst = max(views, key=lambda view: view.outliers.mean())
            found.append(
                f"{sensor}: {far} of {every} {of} are outliers, most in shot {worst.shot}; look at its picture, "
                "and leave it out if the board moved or is covered"
            )
    return found
