"""Verdict on a calibration, in words."""

from collections.abc import Callable, Collection, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from calib.formats.plausibility import exchanged
from calib.solve.calibrate import calibrate
from calib.solve.solution import Solution
from calib.solve.validation import changes, projection_uncertainty
from calib.solve.validation.board_shape import ShapeError, shape_errors
from calib.solve.validation.contradictions import SCATTERS_PX, Contradiction, Scatter, contradictions, outliers, scatter
from calib.solve.validation.cross_validation import Agreement, TooFewToSplitError, cross_validate
from calib.solve.validation.distance_errors import distance_errors
from calib.solve.validation.free_shape import FreeShape, free_shape
from calib.solve.validation.groups import groups
from calib.solve.validation.other_lens import other_lenses, undescribed
from calib.solve.validation.projection_uncertainty import UncertaintyMap
from calib.solve.validation.steadiness import changes_of_optics, changes_of_place, focal_scatter, unseen_change
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
    shape, free = shape_errors(solution, distance, needed_px), free_shape(solution)
    unlike = _unlike(free, shape, needed_px)
    reasons, contradicting = [*unlike.reasons], unlike.contradicting
    reasons += exchanged(solution.cameras)
    reasons += weak_directions(solution, distance)
    reasons += outliers(solution, {one.shot for one in contradicting})
    reasons += undescribed(solution, needed_px)
    try:
        agreements = cross_validate(solution, distance, note, half)
        reasons += _disagreeing(agreements, needed_px)
    except TooFewToSplitError as error:
        agreements = []
        reasons.append(f"two halves could not be compared: {error}")
    known = {of: field.rms * RADIUS_95 * _excess(of, agreements) for of, field in {**images, **pairs}.items()}
    reasons += _uncertain(known, needed_px)
    reasons += _narrow(solution, images)
    reasons += [str(one) for one in shape if not one.is_misprint]  # why the halves may differ
    reasons = [*other_lenses(solution), *unlike.causes, *reasons] if reasons else []
    kept = [name for name, sensor in solution.task.sensors.items() if sensor.fixed_intrinsics]
    praise = _praise(agreements, images, known, distance) + changes.unseen(unseen_change(free)) + _given(kept)
    verdict = f"Do not trust it yet: {reasons[0]}" if reasons else praise
    return Assessment(not reasons, verdict, reasons, contradicting, agreements, images, pairs, distance)


class _Unlike(NamedTuple):
    """Reasons to doubt that all shots show one board and one rig, shots that contradict, and likely causes."""

    reasons: Sequence[str]
    contradicting: Sequence[Contradiction]
    causes: Sequence[str]


def _unlike(free: FreeShape, shape: Sequence[ShapeError], needed_px: float) -> _Unlike:
    """Looks whether all shots show one board and one rig."""
    solution = free.solution
    if wrong := distance_errors(solution, needed_px):
        return _Unlike([*map(str, wrong)], [], [])  # they pull everything else along
    moved = changes_of_place(free, needed_px)
    # What happened to a sensor looks as if its image changed, and a wrong board as if every shot had another lens.
    changed = [] if moved else changes_of_optics(free, needed_px)
    confirmed = [changes.is_confirmed(solution, one) for one in changed]
    refocused = [one for one, is_so in zip(changed, confirmed) if is_so]
    contradicting = [] if moved else contradictions(solution, free.misses)
    scattered = [] if moved else _scattered(solution, contradicting, SCATTERS_PX)
    if scattered:
        contradicting = []  # without a rest, nothing contradicts it
    misprinted = [str(one) for one in shape if one.is_misprint]
    lasting = moved or refocused or misprinted or scattered
    mixed = [] if lasting or contradicting or shape else groups(free, needed_px)
    focus = {} if lasting or contradicting or mixed else focal_scatter(free, needed_px)
    cause = [] if lasting or solution.task.planes else _scattered(solution, contradicting, 0.0)  # or wrong distances
    reasons = [changes.of_place(one) for one in moved]
    reasons += [changes.of_optics(one, len(solution.task.sensors)) for one in refocused]
    reasons += [*misprinted, *map(str, mixed), *(changes.of_focus(*each) for each in focus.items())]
    reasons += [*map(str, scattered), *_contradicting(contradicting)]
    reasons += [changes.unexplained(one) for one, is_so in zip(changed, confirmed) if not is_so]
    return _Unlike(reasons, contradicting, [*map(str, cause)])


def _excess(of: str, agreements: Sequence[Agreement]) -> float:
    """Factor by which a projection is known worse than its deviation says, as the halves differ beyond chance."""
    return max((each.ratio for each in agreements if each.of == of and each.ratio > MAX_RATIO), default=1.0)


def _praise(
    agreements: Sequence[Agreement], images: Mapping[str, UncertaintyMap], known: Mapping[str, float], distance: float
) -> str:
    most = max((each for each in known.values() if not np.isnan(each)), default=0)
    seen = min(field.inside.mean() for field in images.values())
    where = f" where boards were seen, in {seen:.0%} of the image" if seen < 1 else ""
    text = f"Trust it: projections at {distance:.2g} m are known to {most:.2g} px (95 %){where}"
    if agreements:
        worst = max(agreements, key=lambda each: each.ratio)
        text += (
            f", and the halves of the shots differ by {worst.difference_px:.2g} px where "
            f"{worst.predicted_px:.2g} px were predicted ({worst.of}, the worst)"
        )
    return text + "."


def _given(kept: Sequence[str]) -> str:
    """Sentence on sensors whose intrinsics were not estimated; "" without any."""
    names = " and ".join(kept)
    return f" That takes the intrinsics of {names} as given." if kept else ""


def _disagreeing(agreements: Sequence[Agreement], needed_px: float) -> list[str]:
    between = ", if only between the images of a shot" if any("→" in each.of for each in agreements) else ""
    bad = [each for each in agreements if each.ratio > MAX_RATIO and each.difference_px > HARMLESS * needed_px]
    return [
        f"{each.of}: the halves of the shots differ by {each.difference_px:.2g} px where {each.predicted_px:.2g} px "
        f"were predicted; the kind of lens does not fit, the board is not flat, or something moved{between}: "
        "take more tilted views, and try another kind of lens"
        for each in sorted(bad, key=lambda each: -each.ratio)
    ]


def _uncertain(radii: Mapping[str, float], needed_px: float) -> list[str]:
    found = []
    for of, known in radii.items():
        if known > needed_px:
            found.append(
                f"{of}: projections are known to {known:.2g} px only (95 %) where {needed_px:.2g} px are needed; take "
                "more tilted views, and fill the corners of the image"
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


def _contradicting(found: Sequence[Contradiction]) -> list[str]:
    if not found:
        return []
    count = f"{len(found)} shots contradict" if len(found) > 1 else "one shot contradicts"
    return [
        f"{count} the others: {'; '.join(map(str, found))}. Look at the pictures, and leave out what is wrong: "
        f"--skip {','.join(str(shot) for shot in sorted(one.shot for one in found))}"
    ]


def _scattered(solution: Solution, contradicting: Sequence[Contradiction], least_px: float) -> list[Scatter]:
    found = scatter(solution, least_px)
    if found and contradicting:  # a few wrong shots spoil the others until they are left out
        found = _scatter_without({one.shot for one in contradicting}, solution, least_px)
    return found


def _scatter_without(shots: Collection[int], solution: Solution, least_px: float) -> list[Scatter]:
    rest = solution.task.of_shots([shot for shot in solution.task.shots if shot not in shots])
    try:
        return scatter(calibrate(rest), least_px)
    except ValueError:  # nor can the rest be calibrated
        return scatter(solution, least_px)
