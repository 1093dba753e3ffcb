"""A tracker in a running rig: takes frame sets, publishes estimates."""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from statistics import median

from abs_service.bus.clock_offsets import ClockOffsets, Offset
from abs_service.bus.frames import DEPTH, FrameSubscriber
from abs_service.bus.health import Health, Level
from abs_service.pairing.observation import ObservationError
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracking.estimate_publisher import EstimatePublisher
from abs_service.tracking.monitors.noise_monitor import NoiseMonitor
from abs_service.tracking.monitors.silence_monitor import SilenceMonitor
from abs_service.tracking.session import TrackingSession
from abs_service.wire.estimate_messages import Effort
from drivers.contract.frame import FrameSet

#: Timeout of the wait for a frame [s]; bounds the reaction time to a stop request.
POLL_S = 0.05
#: Processing times in the running median: robust against a few slow frames, as after a stall.
DURATIONS = 9


class FrameSetQueue:
    """Queue of frame sets, with frame skipping if the tracker is slower than the cameras.

    A tracker that is faster than the cameras gets all of them, in order: the backlog after a stall of the machine is
    processed within a few frames. A slower one gets the newest, so that latency does not grow; the others are counted.

    Args:
        frames: the frames.
        synchroniser: makes sets of them.
        clock: CLOCK_MONOTONIC [ns].

    Attributes:
        skipped: frame sets passed over.
    """

    def __init__(self, frames: FrameSubscriber, synchroniser: Synchroniser, clock: Callable[[], int]):
        self.skipped = 0
        self._frames = frames
        self._synchroniser = synchroniser
        self._clock = clock
        self._waiting: deque[FrameSet] = deque()
        self._durations_ns: deque[int] = deque(maxlen=DURATIONS)
        self._taken_ns: int | None = None  # when the set was taken that is being worked on

    @property
    def counters(self) -> Mapping[str, int]:
        """Counters of losses.

        `skipped` frame sets; by topic, frames that were published and `lost` on the bus, frames `dropped` unseen here
        and `malformed` messages; by stream and cause, frames that are in no set and so `unused`.
        """
        counters = {"skipped": self.skipped}
        counters |= {f"lost.{topic}": number for topic, number in self._frames.lost.items()}
        counters |= {f"dropped.{topic}": number for topic, number in self._frames.dropped.items()}
        counters |= {f"malformed.{topic}": number for topic, number in self._frames.malformed.items()}
        counters |= {f"unused.{stream}": number for stream, number in self._synchroniser.counters.items()}
        return counters

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames so far that are in no set, by sensor, whatever the cause."""
        total: Counter[str] = Counter()
        frames = self._frames
        for counts in (frames.lost, frames.dropped, frames.malformed, self._synchroniser.counters):
            for name, number in counts.items():
                total[name.partition("/")[0]] += number
        return total

    @property
    def last_error(self) -> str:
        """Error of the last malformed message; "" if there was none."""
        return self._frames.last_error

    def take(self) -> FrameSet | None:
        """The next set; None if there is none yet. The call ends the processing of the last one."""
        if self._taken_ns is not None:
            self._durations_ns.append(self._clock() - self._taken_ns)
        self._collect()
        allowed = DEPTH if self._keeps_up() else 1
        while len(self._waiting) > allowed:
            self._waiting.popleft()
            self.skipped += 1
        self._taken_ns = self._clock() if self._waiting else None
        return self._waiting.popleft() if self._waiting else None

    def _collect(self) -> None:
        frame = self._frames.take(0 if self._waiting else POLL_S)
        while frame is not None:
            self._waiting.extend(self._synchroniser.add(frame))
            frame = self._frames.take(0)
        self._waiting.extend(self._synchroniser.poll(self._clock()))

    def _keeps_up(self) -> bool:
        """True if the median processing time is below the interval between the queued sets."""
        if len(self._waiting) < 2 or not self._durations_ns:
            return False
        interval_ns = (self._waiting[-1].stamp_ns - self._waiting[0].stamp_ns) / (len(self._waiting) - 1)
        return median(self._durations_ns) < interval_ns


class LiveTracker:
    """One tracker on a bus.

    Args:
        tracking: the tracker.
        sets: its frame sets.
        publisher: publishes its estimates.
        health: of the tracker.
        noise_monitor: compares residuals with the noise models.
        clock: CLOCK_MONOTONIC [ns].
        clocks: relates the clock of the cameras' host to it.
        budget_ms: time that the search may take per frame set; the rest of the interval is for everything else.
    """

    def __init__(
        self,
        tracking: TrackingSession,
        sets: FrameSetQueue,
        publisher: EstimatePublisher,
        health: Health,
        noise_monitor: NoiseMonitor,
        clock: Callable[[], int],
        clocks: ClockOffsets,
        budget_ms: float,
    ):
        self._tracking = tracking
        self._sets = sets
        self._publisher = publisher
        self._health = health
        self._noise_monitor = noise_monitor
        self._clock = clock
        self._clocks = clocks
        self._budget_ns = round(budget_ms * 1e6)
        self._reported = 0
        self._silence_monitor = SilenceMonitor(clock)
        self._rejected = 0
        self._losses_before = self._losses()  # at the last estimate

    def process_next(self) -> None:
        """Processes the next frame set, if there is one."""
        frames = self._sets.take()
        if frames is None:
            return
        begin_ns = self._clock()
        try:
            estimate = self._tracking.track(frames, lambda: self._clock() - begin_ns < self._budget_ns)
        except ObservationError as error:
            self._rejected += 1
            self._health.count("rejected")
            self._health.report("observation", Level.ERROR, str(error))
            return
        solve_ms = (self._clock() - begin_ns) * 1e-6
        skipped = self._sets.skipped - self._reported
        self._reported = self._sets.skipped
        known = self._clocks.offset(frames.host_clock)
        # As long as the offset is unknown, stamps tell when the estimate was made.
        offset = Offset(self._clock() - estimate.t_host_ns, 0) if known is None else known
        age_ms, age_error_ms = self._age_ms(estimate.t_host_ns, known)
        effort = Effort(solve_ms, self._budget_ns * 1e-6, age_ms, age_error_ms, skipped, self._sets.dropped)
        self._publisher.publish(estimate, self._tracking, effort, frames.host_clock, offset)
        self._silence_monitor.add()
        self._losses_before = self._losses()
        self._report(estimate, solve_ms)

    def report(self) -> None:
        """Updates the loss counters of health, also if no frame arrives; call it before `Health.tick`."""
        self._health.count_up_to(self._sets.counters)
        if self._sets.last_error:
            self._health.label("malformed", self._sets.last_error)
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

    def _age_ms(self, t_host_ns: int, known: Offset | None) -> tuple[float, float]:
        """Time since an exposure and its largest error; NaN if the offset between the clocks is unknown."""
        if known is None:
            return float("nan"), float("nan")
        self._health.gauge("clock.offset_s", known.ns * 1e-9)
        self._health.gauge("clock.error_ms", known.error_ns * 1e-6)
        return (self._clock() - t_host_ns - known.ns) * 1e-6, known.error_ns * 1e-6

    def _report(self, estimate: Estimate, solve_ms: float) -> None:
        self._health.count("estimates")
        self._health.gauge("solve_ms", solve_ms)
        self._health.label("phase", estimate.status.lower())
        level = Level.OK if estimate.status in (Status.TRACKING, Status.INITIALIZING) else Level.WARNING
        message = "" if level == Level.OK else f"{estimate.status}: {'; '.join(estimate.reasons)}"
        self._health.report("observation", Level.OK)
        self._health.report("status", level, message)
        self._health.report("object", Level.WARNING if estimate.warnings else Level.OK, "; ".join(estimate.warnings))
        self._noise_monitor.add(estimate)
