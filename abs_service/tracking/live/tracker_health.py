"""Health of a live tracker: its losses, its status, its silence, and the noise that its residuals show."""

from collections import Counter
from collections.abc import Callable, Mapping

from abs_service.bus.clock_offsets import Offset
from abs_service.bus.health import Health, Level
from abs_service.pairing.frame_set_queue import FrameSetQueue
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracking.monitors.noise_monitor import NoiseMonitor
from abs_service.tracking.monitors.silence_monitor import SilenceMonitor


class TrackerHealth:
    """Reports of one live tracker."""

    def __init__(self, health: Health, sets: FrameSetQueue, clock: Callable[[], int]):
        self._health = health
        self._sets = sets
        self._noise_monitor = NoiseMonitor(health)
        self._silence_monitor = SilenceMonitor(clock)
        self._rejected = 0
        self._losses_before = self._losses()  # at the last estimate

    def add(self, estimate: Estimate, solve_ms: float) -> None:
        """Reports an estimate that took a time [ms]."""
        self._silence_monitor.add()
        self._losses_before = self._losses()
        self._health.count("estimates")
        self._health.gauge("solve_ms", solve_ms)
        self._health.label("phase", estimate.status.lower())
        level = Level.OK if estimate.status in (Status.TRACKING, Status.INITIALIZING) else Level.WARNING
        message = "" if level == Level.OK else f"{estimate.status}: {'; '.join(estimate.reasons)}"
        self._health.report("observation", Level.OK)
        self._health.report("status", level, message)
        self._health.report("object", Level.WARNING if estimate.warnings else Level.OK, "; ".join(estimate.warnings))
        self._noise_monitor.add(estimate)

    def reject(self, reason: str) -> None:
        """Reports a frame set that cannot be tracked."""
        self._rejected += 1
        self._health.count("rejected")
        self._health.report("observation", Level.ERROR, reason)

    def add_offset(self, offset: Offset) -> None:
        """Reports the offset between the clocks of this host and of the cameras'."""
        self._health.gauge("clock.offset_s", offset.ns * 1e-9)
        self._health.gauge("clock.error_ms", offset.error_ns * 1e-6)

    def report(self) -> None:
        """Updates the loss counters, also if no frame arrives; call it before `Health.tick`."""
        self._health.count_up_to(self._sets.counters)
        if self._sets.last_error:
            self._health.label("malformed", self._sets.last_error)
        doubt = self._sets.clock_doubt
        self._health.report("clocks", Level.WARNING if doubt else Level.OK, doubt)
        silence = self._silence_monitor.check()
        message = f"{silence}: {self._cause_of_silence()}" if silence else ""
        self._health.report("estimates", Level.ERROR if silence else Level.OK, message)

    def _cause_of_silence(self) -> str:
        """The commonest losses of frames since the last estimate, as text."""
        since = Counter(self._losses())
        since.subtract(self._losses_before)
        causes = [f"{name} {number}" for name, number in since.most_common(3) if number > 0]
        return f"since then {', '.join(causes)}" if causes else "no frames come from the cameras"

    def _losses(self) -> Mapping[str, int]:
        return {**self._sets.counters, "rejected": self._rejected}
