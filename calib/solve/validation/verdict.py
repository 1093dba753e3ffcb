"""Verdict on a calibration, in words."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass

import numpy as np

from calib.formats.plausibility import exchanged
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.validation import projection_uncertainty
from calib.solve.validation.board_shape import shape_errors
from calib.solve.validation.cross_validation import Agreement, TooFewToSplitError, cross_validate
from calib.solve.validation.free_shape import free_shape
from calib.solve.validation.inconsistent_shots.changes import unseen
from calib.solve.validation.inconsistent_shots.contradictions import Contradiction, outliers
from calib.solve.validation.inconsistent_shots.findings import inconsistent_shots
from calib.solve.validation.inconsistent_shots.steadiness import unseen_change
from calib.solve.validation.other_lens import other_lenses, undescribed
from calib.solve.validation.projection_uncertainty import UncertaintyMap
from calib.solve.validation.rolling_shutter import Motion, motions, noticed
from calib.solve.validation.square_pixels import doubts, not_square, remarks
from calib.solve.validation.weak_directions import weak_directions

#: Largest ratio of observed to predicted difference of the halves; exceeded by chance in about 1 % of the cases.
MAX_RATIO = 2.0

#: Radius of the 95 % confidence circle in two dimensions, in deviations.
RADIUS_95 = 2.45

#: Differences of the halves below this share of the required accuracy are harmless.
HARMLESS = 0.25

#: Largest deviation of a focal length [1], and smallest part of an image in which boards are seen; real sets of single
#: cameras have 0.005, and 0.2 of the image.
MAX_FOCAL, MIN_SEEN = 0.02, 0.1


@dataclass(frozen=True)
class Assessment:
    """Assessment of a solution.

    Attributes:
        trusted: True if the solution is fit for use.
        verdict: one line that begins with "Trust it" or "Do not trust it yet".
        reasons: objections, each with a remedy; empty if trusted.
        contradicting: shots that contradict the rest.
        agreements: of the two halves; empty with too few shots.
        images: uncertainty of each sensor's projection, by name.
        pairs: uncertainty of each depth sensor's points in the other images, by "tof → color".
        distance: of the scene [m].
    """

    trusted: bool
    verdict: str
    reasons: Sequence[str]
    contradicting: Sequence[Contradiction]
    agreements: Sequence[Agreement]
    images: dict[str, UncertaintyMap]
    pairs: dict[str, UncertaintyMap]
    distance: float


def assess(
    solution: Solution,
    distance: float,
    needed_px: float,
    note: Callable[[str], None] = lambda _: None,
    half: Set[int] = frozenset(),
) -> Assessment:
    """Cross-validates and judges a solution.

    Args:
        solution: from all shots.
        distance: of the scene [m].
        needed_px: required accuracy of projections, 95 % of the time [px].
        note: called with progress messages.
        half: shots of one half of the cross-validation; every other pose if empty.
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
    moved, pixels, free = motions(solution, distance), not_square(solution, distance), free_shape(solution)
    shared = [*shape_errors(solution, distance, needed_px), *noticed(moved, needed_px)]
    unlike = inconsistent_shots(free, shared, needed_px)
    reasons, contradicting = [*unlike.reasons], unlike.contradicting
    reasons += exchanged(solution.cameras)
    reasons += weak_directions(solution, distance)
    reasons += outliers(solution, {one.shot for one in contradicting})
    reasons += undescribed(solution, needed_px)
    reasons += doubts(pixels, needed_px)
    try:
        agreements = cross_validate(solution, distance, note, half)
        reasons += _disagreeing(agreements, {view.sensor for view in solution.task.planes}, needed_px)
    except TooFewToSplitError as error:
        agreements = []
        reasons.append(f"two halves could not be compared: {error}")
    known = _known({**images, **pairs}, agreements, moved)
    reasons += _uncertain(known, needed_px)
    reasons += _narrow(solution, images)
    reasons += [str(one) for one in shared if one.is_bend]  # why the halves may differ
    reasons = [*other_lenses(solution), *unlike.causes, *reasons] if reasons else []
    kept = [name for name, sensor in solution.task.sensors.items() if sensor.fixed_intrinsics]
    praise = _praise(agreements, images, known, distance) + remarks(pixels) + unseen(unseen_change(free)) + _given(kept)
    verdict = f"Do not trust it yet: {reasons[0]}" if reasons else praise
    return Assessment(not reasons, verdict, reasons, contradicting, agreements, images, pairs, distance)


def _known(
    fields: Mapping[str, UncertaintyMap], agreements: Sequence[Agreement], moved: Sequence[Motion]
) -> dict[str, float]:
    """Errors of projections that 95 % are below, by name [px]; motions are in no covariance."""
    return {
        of: RADIUS_95 * float(np.hypot(field.rms * _excess(of, agreements), _bias(of, moved)))
        for of, field in fields.items()
    }


def _excess(of: str, agreements: Sequence[Agreement]) -> float:
    """Factor by which a projection is known worse than its deviation says, as the halves differ beyond chance."""
    return max((each.ratio for each in agreements if each.of == of and each.ratio > MAX_RATIO), default=1.0)


def _bias(of: str, moved: Sequence[Motion]) -> float:
    """Deviation of a coordinate in a sensor's image by motions [px]."""
    return sum(one.effect_px for one in moved if one.sensor == of) / np.sqrt(2)


def _praise(
    agreements: Sequence[Agreement], images: Mapping[str, UncertaintyMap], known: Mapping[str, float], distance: float
) -> str:
    maximum = max((each for each in known.values() if not np.isnan(each)), default=0)
    seen = min(field.inside.mean() for field in images.values())
    where = f" where boards were seen, in {seen:.0%} of the image" if seen < 1 else ""
    text = f"Trust it: projections at {rounded(distance)} m are known to {rounded(maximum)} px (95 %){where}"
    if agreements:
        worst = max(agreements, key=lambda each: each.ratio)
        text += (
            f", and the halves of the shots differ by {rounded(worst.difference_px)} px where "
            f"{rounded(worst.predicted_px)} px were predicted ({worst.of}, the worst)"
        )
    return text + "."


def _given(kept: Sequence[str]) -> str:
    """Sentence on sensors whose intrinsics were not estimated; "" without any."""
    names = " and ".join(kept)
    return f" That takes the intrinsics of {names} as given." if kept else ""


def _disagreeing(agreements: Sequence[Agreement], measuring: Set[str], needed_px: float) -> list[str]:
    bad = [each for each in agreements if each.ratio > MAX_RATIO and each.difference_px > HARMLESS * needed_px]
    # A wrong kind of lens shows in each sensor, wrong distances only beside another one.
    right = {each.of for each in agreements if each not in bad} - measuring
    in_rig = any("→" in each.of for each in agreements)
    between = ", if only between the images of a shot" if in_rig else ""
    return [
        f"{each.of}: the halves of the shots differ by {rounded(each.difference_px)} px where "
        f"{rounded(each.predicted_px)} px were predicted{_why(each.of, right, between)}"
        for each in sorted(bad, key=lambda each: -each.ratio)
    ]


def _why(of: str, right: Set[str], when: str) -> str:
    """The likely cause of halves that differ in a sensor or pair, and what to do.

    Args:
        of: the sensor or pair.
        right: sensors about which the halves agree.
        when: clause on when something may have moved; "" if it goes without saying.
    """
    if {*of.split(" → ")} <= right:
        return (
            ", and agree about each of the two: the images of a shot were not taken at the same moment, a sensor was "
            "moved, or the board is not flat; hold the board still in every shot, or synchronise the sensors"
        )
    return (
        f"; the kind of lens does not fit, the board is not flat, or something moved{when}: take more tilted views, "
        "and try another kind of lens"
    )


def _uncertain(radii: Mapping[str, float], needed_px: float) -> list[str]:
    found = []
    for of, known in radii.items():
        if known > needed_px:
            found.append(
                f"{of}: projections are known to {rounded(known)} px only (95 %) where {rounded(needed_px)} px are "
                "needed; take more tilted views, and fill the corners of the image"
            )
        if np.isnan(known):
            found.append(f"{of}: nothing that the one sees at this distance is near the image of the other")
    return found


def _narrow(solution: Solution, images: dict[str, UncertaintyMap]) -> list[str]:
    """Focal lengths that are hardly known, and images in which the board was hardly seen."""
    relative = {each.name: each.sigma / each.value for each in solution.parameters if each.name.endswith(".fx")}
    return [
        f"{name.removesuffix('.fx')}: its focal length is known to ± {each:.1%} only, and projections at the distance "
        "of the boards alone: tilt the board by 20° to 40° to all sides, and take it nearer and further"
        for name, each in relative.items()
        if each > MAX_FOCAL
    ] + [
        f"{of}: the board was seen in {field.inside.mean():.0%} of the image only, elsewhere the lens is extrapolated: "
        "come closer, and fill the corners of the image"
        for of, field in images.items()
        if field.inside.mean() < MIN_SEEN
    ]
