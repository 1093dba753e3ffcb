"""Reinitialization of a lost object: when to attempt it, and hysteresis of the status after it."""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.estimates import status
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracker.mesh import Mesh
from abs_service.tracking.monitors.common_colors import common_share


@dataclass(frozen=True)
class Settings:
    """TOML keys of `reinitialization`.

    Attributes:
        after_s: time that the object must be LOST before the first attempt [s]. Until then, and between attempts, the
            search continues from the last estimate, so that a briefly occluded object keeps its mesh.
        keep_s: time after the loss in which the old mesh is relocated onto the detected object, so that its vertices
            keep their material points; later, a new mesh is made [s]. For scenes without similar objects.
        every_s: time between two attempts [s].
        confirm: number of consecutive good estimates from which on the status is TRACKING after a loss, with a new
            mesh, or after `misfit_s` without TRACKING; before, it is DEGRADED.
        size_ratio: largest ratio between the areas of the detected and the lost object, and between the mean squared
            distances of their points from their centres; others are rejected, because an empty scene has surfaces, too.
            So are those that share less than one part in `size_ratio` of their colours with the lost one.
        grow_s: time for which the object must be seen to continue beyond edges of the mesh that something hid at first
            before a new, larger mesh is made [s].
        misfit_s: time without TRACKING after which single good estimates are chance, and after which a new mesh is made
            if the free edges lay off the object's outline at its beginning, and still do (`status.degraded_rim`,
            `status.degraded_rim_m`) [s].
    """

    after_s: Annotated[float, Ge(0)] = 0.5
    keep_s: Annotated[float, Ge(0)] = 0.0
    every_s: Annotated[float, Gt(0)] = 0.2
    confirm: Annotated[int, Ge(1)] = 3
    size_ratio: Annotated[float, Gt(1)] = 1.8
    grow_s: Annotated[float, Ge(0)] = 2.0
    misfit_s: Annotated[float, Ge(0)] = 1.0


class LossMonitor:
    """Status of one tracker over time."""

    def __init__(self, settings: Settings, limits: status.Settings):
        self._limits = limits
        self._settings = settings
        self._lost_ns: int | None = None
        self._tried_ns: int | None = None
        self._off_ns: int | None = None
        self._doubted_ns: int | None = None  # first estimate without TRACKING since the last one with it
        self._is_off = self._was_lost = False  # was lost since the last estimate with TRACKING
        self._good = settings.confirm
        self._event = "found again"

    @property
    def is_lost(self) -> bool:
        """True from the first LOST estimate to the next one that is not."""
        return self._lost_ns is not None

    def take_attempt(self, t_ns: int) -> bool:
        """True if an attempt is due at `t_ns` [ns]; it then counts as made."""
        if self._is_off and self._off_ns is not None and t_ns - self._off_ns >= self._settings.misfit_s * 1e9:
            self._off_ns = None
            return True
        if not (self._is_lost_for_good(t_ns) or self._is_left_over(t_ns)):
            return False
        if self._tried_ns is not None and t_ns - self._tried_ns < self._settings.every_s * 1e9:
            return False
        self._tried_ns = t_ns
        return True

    def _is_lost_for_good(self, t_ns: int) -> bool:
        return self._lost_ns is not None and t_ns - self._lost_ns >= self._settings.after_s * 1e9

    def _is_left_over(self, t_ns: int) -> bool:
        """True if the mesh of a lost object caught on something, in doubt ever since."""
        since = self._doubted_ns if self._was_lost and not self.is_lost and not self._good else None
        return since is not None and t_ns - since >= self._settings.misfit_s * 1e9

    def keeps_mesh(self, t_ns: int) -> bool:
        """True if an object detected at `t_ns` [ns] gets the old mesh."""
        return self._lost_ns is not None and t_ns - self._lost_ns < self._settings.keep_s * 1e9

    def with_hysteresis(self, estimate: Estimate) -> Estimate:
        """The estimate with hysteresis: the first good estimates after a loss, or after a long doubt, are DEGRADED."""
        self._is_off = status.is_misplaced(estimate.fits, estimate.shape, self._limits)
        if self._is_off:
            self._off_ns = self._off_ns or estimate.t_host_ns
        if estimate.status == Status.TRACKING:
            return self._confirmed(estimate)
        self._doubted_ns = self._doubted_ns or estimate.t_host_ns
        if estimate.status == Status.LOST:
            self._lost_ns = estimate.t_host_ns if self._lost_ns is None else self._lost_ns
            self._good, self._event, self._was_lost = 0, "found again", True
            return estimate
        self._lost_ns = None
        if self._good < self._settings.confirm:
            self._good = 0
        elif estimate.t_host_ns - self._doubted_ns >= self._settings.misfit_s * 1e9:
            self._good, self._event = 0, "agrees again in all checks"
        return estimate

    def _confirmed(self, estimate: Estimate) -> Estimate:
        """A good estimate, DEGRADED unless enough were good before: a jammed mesh agrees in some frames only."""
        self._lost_ns = None
        self._good += 1
        if self._good < self._settings.confirm:
            reason = f"{self._event} {self._good} of {self._settings.confirm} estimates ago"
            return replace(estimate, status=Status.DEGRADED, reasons=(*estimate.reasons, reason))
        self._doubted_ns, self._was_lost = None, False
        if not self._is_off:
            self._off_ns = None
        return estimate

    def restart(self, event: str) -> None:
        """Makes the next estimates DEGRADED as after a loss, because of an event such as "a larger mesh was made"."""
        self._good, self._event = 0, f"found again, {event}" if self.is_lost else event

    def check_likeness(self, found: Mesh, lost: Mesh) -> None:
        """DetectionError if the detected object has another area, spread or appearance than the lost one."""
        if self._differ(found.area, lost.area):
            raise DetectionError(f"what is in sight has {found.area * 1e4:.0f} cm², not {lost.area * 1e4:.0f} cm²")
        self._check_spread(found.vertices, lost.vertices)
        self._check_appearance(found, lost)

    def _check_spread(self, found: NDArray[np.float64], lost: NDArray[np.float64]) -> None:
        """A strip may have the area of a sheet, and so have the bits of a room that make a mesh."""
        reach, expected = _spread(found), _spread(lost)
        if self._differ(reach**2, expected**2):
            raise DetectionError(
                f"what is in sight spreads by {reach * 1e2:.0f} cm about its centre (root mean square), "
                f"not by {expected * 1e2:.0f} cm"
            )

    def _check_appearance(self, found: Mesh, lost: Mesh) -> None:
        """A part of the object may be in sight, as small as its size allows, and that may be the part of one colour."""
        for sensor, appearance in lost.appearance.items():
            shared = common_share(found.appearance_of(sensor), appearance)
            if shared < 1 / self._settings.size_ratio:
                raise DetectionError(
                    f"what is in sight shares {shared:.0%} of its colours in {sensor} with the lost object"
                )

    def _differ(self, found: float, lost: float) -> bool:
        return not 1 / self._settings.size_ratio < found / lost < self._settings.size_ratio


def _spread(points: NDArray[np.float64]) -> float:
    """Root mean square distance [m] of points (k, 3) from their centre, which a bend hardly changes."""
    return float(np.sqrt(points.var(axis=0).sum()))
