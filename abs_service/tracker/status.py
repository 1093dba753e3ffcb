"""Status of an estimate, from its agreement with the measurements."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from abs_service.tracker.estimate import Status
from abs_service.tracker.terms.base import SensorFit, inlier_share, occluded_share


@dataclass(frozen=True)
class Settings:
    """TOML keys of the status.

    Attributes:
        degraded_below: inlier share below which an estimate is DEGRADED.
        lost_below: inlier share below which the object is LOST.
        degraded_occluded: occluded share above which an estimate is DEGRADED, in the sensor that sees most.
    """

    degraded_below: Annotated[float, Interval(gt=0, lt=1)] = 0.6
    lost_below: Annotated[float, Interval(gt=0, lt=1)] = 0.3
    degraded_occluded: Annotated[float, Interval(gt=0, le=1)] = 0.5


def judge(fits: Sequence[SensorFit], missing: Sequence[str], limits: Settings) -> tuple[Status, tuple[str, ...]]:
    """Status, and the reasons for any other than TRACKING.

    Args:
        fits: agreement of every contributing sensor.
        missing: sensors without a frame.
        limits: thresholds.
    """
    inliers, occluded = inlier_share(fits), occluded_share(fits)
    reasons = [f"no frame from {name}" for name in missing]
    if inliers < limits.degraded_below:
        reasons.append(f"only {inliers:.0%} of the visible vertices agree with a measurement")
    if occluded > limits.degraded_occluded:
        reasons.append(f"{occluded:.0%} of the vertices are occluded in the sensor that sees most of them")
    if inliers < limits.lost_below:
        return Status.LOST, tuple(reasons)
    return (Status.DEGRADED if reasons else Status.TRACKING), tuple(reasons)
