"""A tracker in a running rig: takes the newest frame set, publishes the estimate."""

from collections import Counter
from collections.abc import Callable, Mapping

from abs_service import estimates, keys
from abs_service.bus.contract import MESH, STATE, Bus
from abs_service.bus.frames import FrameSubscriber
from abs_service.estimates import Effort, Identity
from abs_service.health import Health, Level
from abs_service.observation import ObservationError
from abs_service.residuals import ResidualWatch
from abs_service.stamps import Speaker
from abs_service.synchroniser import Synchroniser
from abs_service.tracker.estimate import Estimate, Status
from abs_service.tracking import Tracking
from drivers.frame import FrameSet

#: How long one turn waits for a frame [s]; a reader that is told to stop notices within this time.
TURN_S = 0.05


class NewestSets:
    """The newest frame set there is; older ones that nobody took in time are counted.

    Args:
        frames: where frames come from.
        synchroniser: what makes sets of them.
        clock: CLOCK_MONOTONIC [ns].

    Attributes:
        skipped: frame sets passed over.
    """

    def __init__(self, frames: FrameSubscriber, synchroniser: Synchroniser, clock: Callable[[], int]):
        self.skipped = 0
        self._frames = frames
        self._synchroniser = synchroniser
        self._clock = clock

    @property
    def counters(self) -> Mapping[str, int]:
        """What became no estimate.

        `skipped` frame sets; by topic, frames `dropped` unseen and `malformed` messages; by stream and cause, frames
        that are in no set and so `unused`.
        """
        counters = {"skipped": self.skipped}
        counters |= {f"dropped.{topic}": number for topic, number in self._frames.dropped.items()}
        counters |= {f"malformed.{topic}": number for topic, number in self._frames.malformed.items()}
        counters |= {f"unused.{stream}": number for stream, number in self._synchroniser.counters.items()}
        return counters

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames so far that are in no set, by sensor, whatever the cause."""
        total: Counter[str] = Counter()
        for counts in (self._frames.dropped, self._frames.malformed, self._synchroniser.counters):
            for name, number in counts.items():
                total[name.partition("/")[0]] += number
        return total

    @property
    def last_error(self) -> str:
        """Why the last malformed message was one; "" if there was none."""
        return self._frames.last_error

    def take(self) -> FrameSet | None:
        """The newest set after everything that has arrived; None if there is none yet."""
        sets: list[FrameSet] = []
        frame = self._frames.take(TURN_S)
        while frame is not None:
            sets += self._synchroniser.add(frame)
            frame = self._frames.take(0)
        sets += self._synchroniser.poll(self._clock())
        self.skipped += max(len(sets) - 1, 0)
        return sets[-1] if sets else None


class EstimatePublisher:
    """Publishes the estimates of one tracker, its meshes, and each new mesh's topology."""

    def __init__(self, bus: Bus, speaker: Speaker, tracker: str, model: str, calib_id: str):
        self._speaker = speaker
        self._state = bus.publisher(keys.state(tracker), estimates.STATE, STATE)
        self._mesh = bus.publisher(keys.mesh(tracker), estimates.MESH, MESH)
        self._topology = bus.announce(keys.topology(tracker), estimates.TOPOLOGY)
        self._identity = Identity(tracker, model, "", calib_id, 0)
        self._seq = 0

    def publish(self, estimate: Estimate, tracking: Tracking, effort: Effort) -> None:
        """Publishes an estimate, after the topology of its mesh if that is new."""
        if tracking.mesh is not None and tracking.mesh_version != self._identity.mesh_version:
            self._identity = estimates.with_mesh(self._identity, tracking.mesh, tracking.mesh_version)
            header = self._speaker.header(tracking.made_ns, self._seq, keys.RIG_FRAME)
            self._topology.put(estimates.topology(header, tracking.mesh, self._identity).SerializeToString())
        header = self._speaker.header(estimate.t_host_ns, self._seq, keys.RIG_FRAME)
        self._state.put(estimates.state(header, estimate, self._identity, effort).SerializeToString())
        self._mesh.put(estimates.mesh(header, estimate, self._identity).SerializeToString())
        self._seq += 1


class LiveTracker:
    """One tracker on a bus.

    Args:
        tracking: the tracker.
        sets: where its frame sets come from.
        publisher: where its estimates go.
        health: what others learn about it.
        residuals: tells health which noise model is wrong.
        clock: CLOCK_MONOTONIC [ns].
        budget_ms: time that the search may take per frame set; the rest of the interval is for everything else.
    """

    def __init__(
        self,
        tracking: Tracking,
        sets: NewestSets,
        publisher: EstimatePublisher,
        health: Health,
        residuals: ResidualWatch,
        clock: Callable[[], int],
        budget_ms: float,
    ):
        self._tracking = tracking
        self._sets = sets
        self._publisher = publisher
        self._health = health
        self._residuals = residuals
        self._clock = clock
        self._budget_ns = round(budget_ms * 1e6)
        self._reported = 0

    def turn(self) -> None:
        """Handles the newest frame set, if there is one."""
        frames = self._sets.take()
        if frames is None:
            return
        begin_ns = self._clock()
        try:
            estimate = self._tracking.track(frames, lambda: self._clock() - begin_ns < self._budget_ns)
        except ObservationError as error:
            self._health.count("rejected")
            self._health.report("observation", Level.ERROR, str(error))
            return
        solve_ms = (self._clock() - begin_ns) * 1e-6
        skipped = self._sets.skipped - self._reported
        self._reported = self._sets.skipped
        age_ms = (self._clock() - estimate.t_host_ns) * 1e-6
        effort = Effort(solve_ms, self._budget_ns * 1e-6, age_ms, skipped, self._sets.dropped)
        self._publisher.publish(estimate, self._tracking, effort)
        self._report(estimate, solve_ms)

    def report(self) -> None:
        """Enters what was lost on the way into health, also if nothing arrives; call it before `Health.tick`."""
        self._health.count_up_to(self._sets.counters)
        if self._sets.last_error:
            self._health.label("malformed", self._sets.last_error)

    def _report(self, estimate: Estimate, solve_ms: float) -> None:
        self._health.count("estimates")
        self._health.gauge("solve_ms", solve_ms)
        self._health.label("phase", estimate.status.lower())
        level = Level.OK if estimate.status in (Status.TRACKING, Status.INITIALIZING) else Level.WARNING
        message = "" if level == Level.OK else f"{estimate.status}: {'; '.join(estimate.reasons)}"
        self._health.report("observation", Level.OK)
        self._health.report("status", level, message)
        self._residuals.take(estimate)
