"""How far an estimate can be trusted, from how well it explains the measurements."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from abs_service.tracker.estimate import Status


@dataclass(frozen=True)
class Settings:
    """TOML keys of the verdict.

    Attributes:
        degraded_below: inlier share below which an estimate is DEGRADED.
        lost_below: inlier share below which the object is LOST.
        degraded_hidden: share of hidden vertices above which an estimate is DEGRADED, for the sensor that sees most.
    """

    degraded_below: Annotated[float, Interval(gt=0, lt=1)] = 0.6
    lost_below: Annotated[float, Interval(gt=0, lt=1)] = 0.3
    degraded_hidden: Annotated[float, Interval(gt=0, le=1)] = 0.5


def judge(
    inlier_share: float, hidden_share: float, missing: Sequence[str], settings: Settings
) -> tuple[Status, tuple[str, ...]]:
    """Status and the reasons for anything but TRACKING."""
    reasons = [f"no frame from {name}" for name in missing]
    if inlier_share < settings.degraded_below:
        reasons.append(f"only {inlier_share:.0%} of the visible vertices agree with a measurement")
    if hidden_share > settings.degraded_hidden:
        reasons.append(f"{hidden_share:.0%} of the vertices are hidden from the sensor that sees most of them")
    if inlier_share < settings.lost_below:
        return Status.LOST, tuple(reasons)
    return (Status.DEGRADED if reasons else Status.TRACKING), tuple(reasons)
