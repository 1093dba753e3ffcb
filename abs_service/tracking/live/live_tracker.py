"""A tracker in a running rig: takes frame sets, publishes estimates."""

from collections.abc import Callable

from abs_service.bus.clock_offsets import ClockOffsets, Offset
from abs_service.pairing.frame_set_queue import FrameSetQueue
from abs_service.pairing.observation import ObservationError
from abs_service.tracking.live.estimate_publisher import EstimatePublisher
from abs_service.tracking.live.tracker_health import TrackerHealth
from abs_service.tracking.session import TrackingSession
from abs_service.wire.estimate_messages import Effort


class LiveTracker:
    """One tracker on a bus.

    Args:
        session: the tracker.
        sets: its frame sets.
        publisher: publishes its estimates.
        health: reports its health.
        clock: CLOCK_MONOTONIC [ns].
        clocks: relates the clock of the cameras' host to it.
        budget_ms: time that the search may take per frame set; the rest of the interval is for everything else.
    """

    def __init__(
        self,
        session: TrackingSession,
        sets: FrameSetQueue,
        publisher: EstimatePublisher,
        health: TrackerHealth,
        clock: Callable[[], int],
        clocks: ClockOffsets,
        budget_ms: float,
    ):
        self._session = session
        self._sets = sets
        self._publisher = publisher
        self._health = health
        self._clock = clock
        self._clocks = clocks
        self._budget_ns = round(budget_ms * 1e6)
        self._skipped_before = 0  # at the last estimate

    def process_next(self) -> None:
        """Processes the next frame set, if there is one."""
        frames = self._sets.take()
        if frames is None:
            return
        begin_ns = self._clock()
        try:
            estimate = self._session.track(frames, lambda: self._clock() - begin_ns < self._budget_ns)
        except ObservationError as error:
            self._health.reject(str(error))
            return
        solve_ms = (self._clock() - begin_ns) * 1e-6
        skipped = self._sets.skipped - self._skipped_before
        self._skipped_before = self._sets.skipped
        known = self._clocks.offset(frames.host_clock)
        # As long as the offset is unknown, stamps tell when the estimate was made.
        offset = Offset(self._clock() - estimate.t_host_ns, 0) if known is None else known
        age_ms, age_error_ms = self._age_ms(estimate.t_host_ns, known)
        effort = Effort(solve_ms, self._budget_ns * 1e-6, age_ms, age_error_ms, skipped, self._sets.dropped)
        self._publisher.publish(estimate, self._session, effort, frames.host_clock, offset)
        self._health.add(estimate, solve_ms)

    def _age_ms(self, t_host_ns: int, known: Offset | None) -> tuple[float, float]:
        """Time since an exposure and its largest error; NaN if the offset between the clocks is unknown."""
        if known is None:
            return float("nan"), float("nan")
        self._health.add_offset(known)
        return (self._clock() - t_host_ns - known.ns) * 1e-6, known.error_ns * 1e-6
