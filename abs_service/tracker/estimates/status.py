"""Status of an estimate by agreement with measurements, outline and itself. A reason: what is wrong – what to do."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.estimates.shape_quality import ShapeQuality
from abs_service.tracker.terms.agreement import (
    contradicting,
    distances_share,
    hangs_over,
    has_left,
    image_agrees,
    inlier_share,
    most_agreeing,
    occluded_share,
    of_distances,
    outside_share,
    rim_distance,
    rim_share,
    shows_slide,
    turned_away_share,
    unexplained_share,
)
from abs_service.tracker.terms.sensor_fit import SensorFit

#: The limits on the deviation of vertices shrink with the side of an object that is smaller [m].
SMALL_M = 0.06

#: A print holds a surface to less than this share of `degraded_rim_m`; noise seems to hold a plain one, but to more.
PRINT_SHARE = 0.2


@dataclass(frozen=True)
class Settings:
    """TOML keys of the status.

    Attributes:
        degraded_below: inlier share below which an estimate is DEGRADED.
        lost_below: inlier share, of all sensors or of those of distances alone, below which the object is LOST.
        degraded_agreeing: share that agrees with a measurement, of the vertices that should be in sight, below which an
            estimate is DEGRADED, in the sensor in which most do. Vertices without return, behind an occluder or outside
            the image count against it. As large a share has to be inside the image of a depth sensor and, without a
            template, to face it.
        degraded_occluded: occluded share above which an estimate is DEGRADED, in the sensor that sees most.
        degraded_rim: share of the visible free edges that lie off the outline above which an estimate is DEGRADED.
        degraded_rim_m: distance of the visible free edges from the outline, mean of all or of those across a slide,
            above which an estimate is DEGRADED, if it is above the standard deviation of a vertex as well [m].
        degraded_unexplained: by how much the share of the measured surface beside the mesh may be larger than in the
            first image. Something that touches a square object along one whole side adds 0.2.
        degraded_innovation: distance of an estimate from where the object was expected, in standard deviations of the
            motion prior, above which it is DEGRADED: the prior has held the mesh back.
        degraded_folded: share of folded faces above which an estimate is DEGRADED.
        degraded_deviation_m: standard deviation of the position of a vertex, median over the mesh, above which an
            estimate is DEGRADED [m]. Of a mesh smaller than 6 × 6 cm, as much less as its side (root of its area) is.
        degraded_single_frame_deviation_m: the same standard deviation from the measurements of one frame alone, without
            the past, above which an estimate is DEGRADED; likewise less for a small mesh [m].
    """

    degraded_below: Annotated[float, Interval(gt=0, lt=1)] = 0.6
    lost_below: Annotated[float, Interval(gt=0, lt=1)] = 0.3
    degraded_agreeing: Annotated[float, Interval(gt=0, lt=1)] = 0.5
    degraded_occluded: Annotated[float, Interval(gt=0, le=1)] = 0.5
    degraded_rim: Annotated[float, Interval(gt=0, le=1)] = 0.3
    degraded_rim_m: Annotated[float, Gt(0)] = 0.005
    degraded_unexplained: Annotated[float, Interval(gt=0, le=1)] = 0.25
    degraded_innovation: Annotated[float, Gt(1)] = 2.0
    degraded_folded: Annotated[float, Interval(gt=0, le=1)] = 0.05
    degraded_deviation_m: Annotated[float, Gt(0)] = 0.015
    degraded_single_frame_deviation_m: Annotated[float, Gt(0)] = 0.02

    def for_side(self, side_m: float) -> "Settings":
        """The same for a mesh with a side [m]: what is little of a large one may be most of a small one."""
        scale = min(1.0, side_m / SMALL_M)
        known, by_one = scale * self.degraded_deviation_m, scale * self.degraded_single_frame_deviation_m
        return replace(self, degraded_deviation_m=known, degraded_single_frame_deviation_m=by_one)


def judge(
    fits: Sequence[SensorFit],
    missing: Sequence[str],
    shape: ShapeQuality,
    innovation: float,
    limits: Settings,
    *,
    has_back: bool = False,
) -> tuple[Status, tuple[str, ...]]:
    """Status, and the reasons for any other than TRACKING.

    Args:
        fits: agreement of every contributing sensor.
        missing: sensors without a frame.
        shape: quality of the deformed mesh.
        innovation: see `RecentMotion`.
        limits: thresholds.
        has_back: True for the mesh of a template, which may have sides that the first image does not show; all of a
            mesh made from that image faced the sensor in it.
    """
    fits = [fit.without_back() for fit in fits] if has_back else fits
    gone = has_left(fits, limits.degraded_agreeing)
    lost = gone or min(inlier_share(fits), distances_share(fits)) < limits.lost_below
    reasons = [f"no frame from {name}" for name in missing]
    if gone:
        reasons.append(_left(fits))
    else:
        reasons += _seen(fits, lost, limits) if fits else [_UNMEASURED]
    reasons += _faced(fits, limits)
    reasons += (*_placed(fits, shape, innovation, limits), *_shaped(shape, limits))
    if lost:
        return Status.LOST, tuple(reasons)
    return (Status.DEGRADED if reasons else Status.TRACKING), tuple(reasons)


def _seen(fits: Sequence[SensorFit], lost: bool, limits: Settings) -> Iterator[str]:
    """Reasons from the agreement of the sensors with the vertices."""
    inliers, occluded = inlier_share(fits), occluded_share(fits)
    disagree, hidden = inliers < limits.degraded_below, occluded > limits.degraded_occluded
    advice = _FIND if lost else _FOLLOW
    outvoted = lost and inliers >= limits.lost_below
    if disagree and not outvoted:
        missing = min((fit.counts.share("missing") for fit in of_distances(fits)), default=0.0)
        unmeasured = f", {missing:.0%} of all {_ABSENT['missing']}" if missing > 1 / 2 and not lost else f" – {advice}"
        yield f"only {inliers:.0%} of the visible vertices agree with a measurement{unmeasured}"
    if hidden:
        yield (
            f"{occluded:.0%} of the vertices are occluded in the sensor that sees most of them – "
            "take away what hides the object, or add a camera on another side"
        )
    if outvoted or not disagree:
        yield from _contradicted(fits, advice)
    counts = most_agreeing(fits)
    if not (disagree or hidden) and counts.agreeing < limits.degraded_agreeing * counts.expected:
        cause = max(_ABSENT, key=counts.share)
        yield (
            f"only {counts.agreeing / counts.expected:.0%} of the vertices that should be in sight agree with a "
            f"measurement, {counts.share(cause):.0%} of all {_ABSENT[cause]}"
        )
    elif (outside := outside_share(fits)) > 1 - limits.degraded_agreeing:
        yield (
            f"{outside:.0%} of the vertices that should be in sight are outside the depth image, where nothing says "
            "how far they are – bring the object back into it"
        )


def _left(fits: Sequence[SensorFit]) -> str:
    """Reason of a mesh that the depth sensors cannot see."""
    return (
        f"{outside_share(fits):.0%} of the vertices that should be in sight are outside the depth image, "
        f"{turned_away_share(fits):.0%} of all are turned away, and hardly a distance of the others agrees – {_FIND}"
    )


def _faced(fits: Sequence[SensorFit], limits: Settings) -> Iterator[str]:
    """Reason by how much of what the first image showed has turned away from the sensors of distances."""
    if (away := turned_away_share(fits)) > 1 - limits.degraded_agreeing:
        yield (
            f"{away:.0%} of the vertices, all of which faced the depth sensor at first, are turned away from it, and "
            "nothing says where they are – turn the object back, or have the mesh made anew by abs-service reinitialize"
        )


def _contradicted(fits: Sequence[SensorFit], advice: str) -> Iterator[str]:
    """Reasons by sensors that contradict the others: colours that agree do not outvote distances, nor these colours."""
    for name, what, share in contradicting(fits):
        yield f"only {share:.0%} of the {what} of {name} agree – {advice}"


#: What to do if the mesh does not agree.
_FOLLOW = (
    "take away what touches the object, move it more slowly, give the model more control points, or measure the noise"
)
_FIND = "bring the object back into sight; it is looked for again, at once by abs-service reinitialize"

#: Without any measurement, the object may be in sight or not.
_UNMEASURED = "no sensor delivered all its images, so that nothing was measured – see what unused.* of health counts"

#: What may have happened where the free edges lie off the outline, and what to do.
_SLID = (
    "the mesh has slid or turned on it – it is made anew if that lasts; a print that a colour camera sees would hold "
    "it, or more control points, if waves run along it"
)
_GOES_ON = (
    "nearly all of these end inside it, as where a side comes into sight that the first image did not show, where "
    "something lies against it, or where the mesh has shrunk or slid – take away what lies against it; a new mesh "
    "is made if that lasts"
)
_PAST_THE_END = "a side that the first image did not show to its end hangs over that end, by an unknown distance"

#: Why a vertex is not seen to agree, and what to do.
_ABSENT = {
    "disagreeing": f"disagree – {_FOLLOW}",
    "missing": "have no return – bring the surface nearer, or turn it towards the camera",
    "behind_occluder": "are behind something – take it away, or add a camera on another side",
    "outside": "are outside the image – bring the object back into it",
}


def _placed(fits: Sequence[SensorFit], shape: ShapeQuality, innovation: float, limits: Settings) -> Iterator[str]:
    """Reasons by where the mesh lies."""
    if is_misplaced(fits, shape, limits):
        off_m, why = rim_distance(fits), _SLID if hangs_over(fits) else _GOES_ON
        off = f"{rim_share(fits):.0%} of the free edges lie off the object's outline, by {off_m * 1e3:.0f} mm together"
        yield f"{off} or across a slide: {why}" if np.isfinite(off_m) else f"{_PAST_THE_END}: {_SLID}"
    if any(fit.is_surprised for fit in fits) and not any(np.isfinite(fit.remainder.share) for fit in fits):
        yield (
            "nothing was where the object was expected, so neither its outline nor what lies beside it is judged – "
            "move it more slowly, or raise the camera's rate"
        )
    if (gained := unexplained_share(fits)) > limits.degraded_unexplained:
        yield (
            f"{gained:.0%} more of the measured surface continues beyond the mesh than at first – "
            "take away what touches the object, or have the mesh made anew by abs-service reinitialize"
        )
    if innovation > limits.degraded_innovation:
        yield (
            f"the object moved {innovation:.1f} times as far from where it was expected as priors.speed allows for: "
            "the mesh lags behind – move it more slowly, or raise priors.speed or the camera's rate"
        )


def _shaped(shape: ShapeQuality, limits: Settings) -> Iterator[str]:
    """Reasons from the deformed mesh alone."""
    if shape.folded_share > limits.degraded_folded:
        yield (
            f"{shape.folded_share:.0%} of the faces are folded: the model cannot follow the shape – "
            "give it more control points, or make priors.stretch smaller"
        )
    is_loose = shape.deviation_m > limits.degraded_deviation_m
    if is_loose or shape.single_frame_deviation_m > limits.degraded_single_frame_deviation_m:
        known = f"vertices are known to {shape.deviation_m * 1e3:.0f} mm so far"
        alone = f"a single frame shows vertices to {shape.single_frame_deviation_m * 1e3:.0f} mm only"
        yield (
            f"nothing holds the surface along itself, {known if is_loose else alone}: "
            "it needs a print that a colour camera sees, or free edges in sight"
        )


def is_misplaced(fits: Sequence[SensorFit], shape: ShapeQuality, limits: Settings) -> bool:
    """True if the free edges lie off the outline: too many of them, or by more than the covariances claim.

    If distances and images hold the surface, they count only if they show that it has slid, see `shows_slide`.
    """
    claimed = np.fmax(limits.degraded_rim_m, shape.deviation_m)
    is_off = rim_share(fits) > limits.degraded_rim or bool(rim_distance(fits) > claimed)
    is_held = shape.no_outline_deviation_m < PRINT_SHARE * limits.degraded_rim_m and image_agrees(fits)
    return is_off and (shows_slide(fits) or not is_held)
