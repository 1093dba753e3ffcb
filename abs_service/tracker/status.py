"""Status of an estimate: its agreement with the measurements, with the outline, and with itself."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from abs_service.tracker.estimate import Status
from abs_service.tracker.shape_quality import ShapeQuality
from abs_service.tracker.terms.base import RimFit, SensorFit, inlier_share, occluded_share

#: With fewer visible vertices on the free edges, their shares say nothing.
MIN_RIM = 8


@dataclass(frozen=True)
class Settings:
    """TOML keys of the status.

    Attributes:
        degraded_below: inlier share below which an estimate is DEGRADED.
        lost_below: inlier share below which the object is LOST.
        degraded_occluded: occluded share above which an estimate is DEGRADED, in the sensor that sees most.
        degraded_rim: share of the visible free edges that lie off the outline above which an estimate is DEGRADED.
        degraded_rim_m: mean distance of the visible free edges from the outline above which an estimate is DEGRADED, if
            it is above the standard deviation of a vertex as well [m].
        degraded_surprise: distance of an estimate from where the object was expected, in standard deviations of the
            motion prior, above which it is DEGRADED: the prior has held the mesh back.
        degraded_folded: share of folded faces above which an estimate is DEGRADED.
        degraded_deviation_m: standard deviation of the position of a vertex, median over the mesh, above which an
            estimate is DEGRADED [m].
        degraded_unheld_m: the same standard deviation from the measurements of one frame alone, without the past, above
            which an estimate is DEGRADED [m].
    """

    degraded_below: Annotated[float, Interval(gt=0, lt=1)] = 0.6
    lost_below: Annotated[float, Interval(gt=0, lt=1)] = 0.3
    degraded_occluded: Annotated[float, Interval(gt=0, le=1)] = 0.5
    degraded_rim: Annotated[float, Interval(gt=0, le=1)] = 0.3
    degraded_rim_m: Annotated[float, Gt(0)] = 0.005
    degraded_surprise: Annotated[float, Gt(1)] = 2.0
    degraded_folded: Annotated[float, Interval(gt=0, le=1)] = 0.05
    degraded_deviation_m: Annotated[float, Gt(0)] = 0.015
    degraded_unheld_m: Annotated[float, Gt(0)] = 0.02


def judge(
    fits: Sequence[SensorFit], missing: Sequence[str], shape: ShapeQuality, surprise: float, limits: Settings
) -> tuple[Status, tuple[str, ...]]:
    """Status, and the reasons for any other than TRACKING.

    Args:
        fits: agreement of every contributing sensor.
        missing: sensors without a frame.
        shape: quality of the deformed mesh.
        surprise: see `MotionPrior`.
        limits: thresholds.
    """
    inliers, occluded = inlier_share(fits), occluded_share(fits)
    reasons = [f"no frame from {name}" for name in missing]
    if inliers < limits.degraded_below:
        reasons.append(f"only {inliers:.0%} of the visible vertices agree with a measurement")
    if occluded > limits.degraded_occluded:
        reasons.append(f"{occluded:.0%} of the vertices are occluded in the sensor that sees most of them")
    if is_misplaced(fits, shape, limits):
        reasons.append(
            f"{rim_share(fits):.0%} of the free edges lie off the object's outline, all together "
            f"{rim_distance(fits) * 1e3:.0f} mm on average: the mesh has slid or turned on it"
        )
    if surprise > limits.degraded_surprise:
        reasons.append(
            f"the object moved {surprise:.1f} times as far from where it was expected as priors.speed allows for: "
            "the mesh lags behind"
        )
    if shape.folded_share > limits.degraded_folded:
        reasons.append(f"{shape.folded_share:.0%} of the faces are folded: the model cannot follow the shape")
    if shape.deviation_m > limits.degraded_deviation_m or shape.unheld_m > limits.degraded_unheld_m:
        reasons.append(
            f"nothing holds the surface along itself, vertices are known to {shape.deviation_m * 1e3:.0f} mm so far: "
            "it needs a print that a colour camera sees, or free edges in sight"
        )
    if inliers < limits.lost_below:
        return Status.LOST, tuple(reasons)
    return (Status.DEGRADED if reasons else Status.TRACKING), tuple(reasons)


def is_misplaced(fits: Sequence[SensorFit], shape: ShapeQuality, limits: Settings) -> bool:
    """True if the free edges lie off the outline: too many of them, or by more than the covariances claim."""
    claimed = np.fmax(limits.degraded_rim_m, shape.deviation_m)
    return rim_share(fits) > limits.degraded_rim or bool(rim_distance(fits) > claimed)


def rim_share(fits: Sequence[SensorFit]) -> float:
    """Share of the visible vertices on free edges that lie off the outline; the smallest of the sensors, 0 without."""
    shares = [(rim.outside + rim.inside) / rim.visible for rim in _rims(fits)]
    return min(shares, default=0.0)


def rim_distance(fits: Sequence[SensorFit]) -> float:
    """Mean distance [m] of the visible free edges from the outline; the smallest of the sensors, 0 without."""
    return min((rim.off_m for rim in _rims(fits)), default=0.0)


def _rims(fits: Sequence[SensorFit]) -> list[RimFit]:
    return [fit.rim for fit in fits if fit.rim.visible >= MIN_RIM]
