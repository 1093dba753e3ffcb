"""When a lost object is looked for anew, and when one that is back counts as tracked again."""

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt

from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracker.mesh import Mesh


@dataclass(frozen=True)
class Settings:
    """TOML keys of `reinitialization`.

    Attributes:
        after_s: time that the object must be LOST before it is looked for anew [s]. Until then, and between the
            attempts, the search goes on from the last estimate, so that what was hidden for a moment keeps its mesh.
        keep_s: so long after the loss, the old mesh is laid over what is found, so that its vertices stay the same
            material; then a new mesh is made [s]. It is for objects that nothing else in sight is mistaken for.
        every_s: time between two attempts [s].
        confirm: so many estimates in a row must be good before the first says TRACKING; until then it is DEGRADED.
        size_ratio: what is found must not be larger or smaller than the lost object by more than this factor of its
            area: an empty scene has surfaces, too.
    """

    after_s: Annotated[float, Ge(0)] = 0.5
    keep_s: Annotated[float, Ge(0)] = 0.0
    every_s: Annotated[float, Gt(0)] = 0.2
    confirm: Annotated[int, Ge(1)] = 3
    size_ratio: Annotated[float, Gt(1)] = 2.0


class LossWatch:
    """Follows the verdicts of one tracker."""

    def __init__(self, settings: Settings):
        self._settings = settings
        self._lost_ns: int | None = None
        self._tried_ns: int | None = None
        self._good = settings.confirm

    def overdue(self, t_ns: int) -> bool:
        """Whether the object has been lost for so long at `t_ns` [ns] that an attempt is due; counts it as made."""
        if self._lost_ns is None or t_ns - self._lost_ns < self._settings.after_s * 1e9:
            return False
        if self._tried_ns is not None and t_ns - self._tried_ns < self._settings.every_s * 1e9:
            return False
        self._tried_ns = t_ns
        return True

    def keeps_mesh(self, t_ns: int) -> bool:
        """Whether the old mesh is still to be laid over what is found at `t_ns` [ns]."""
        return self._lost_ns is not None and t_ns - self._lost_ns < self._settings.keep_s * 1e9

    def judge(self, estimate: Estimate) -> Estimate:
        """The estimate with hysteresis: after a loss the first good ones are DEGRADED."""
        if estimate.status == Status.LOST:
            self._lost_ns = estimate.t_host_ns if self._lost_ns is None else self._lost_ns
            self._good = 0
            return estimate
        self._lost_ns = self._tried_ns = None
        self._good += 1
        if self._good >= self._settings.confirm:
            return estimate
        reason = f"found again {self._good} of {self._settings.confirm} estimates ago"
        return replace(estimate, status=Status.DEGRADED, reasons=(*estimate.reasons, reason))

    def is_another(self, found: Mesh, lost: Mesh) -> bool:
        """Whether what was found is of quite another size than what was lost."""
        ratio = found.area / lost.area
        return not 1 / self._settings.size_ratio < ratio < self._settings.size_ratio
