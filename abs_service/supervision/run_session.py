"""One run of a rig: passes messages to the display and heartbeats to the supervisor."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from queue import SimpleQueue

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.bus.health import Health, Level
from abs_service.bus.queues import LatestQueue
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_session.pools import EndedPools
from abs_service.supervision.children.child import PROCESS, Child, ChildState
from abs_service.supervision.display import Display
from abs_service.supervision.health import rig_state
from abs_service.supervision.health.rig_view import RigPlaces, RigView
from abs_service.supervision.health.tracker_silence import TrackerSilence
from abs_service.supervision.supervisor import Supervisor
from abs_service.wire import commands
from abs_service.wire.checked_bus import CheckedBus
from abs_service.wire.sole_publishers import SolePublishers

#: Messages per topic that may wait to be shown.
DEPTH = 64
#: Time between two checks of the children, at most [s].
PERIOD_S = 0.05
#: Period and timeout of queries for lost topologies [s].
QUERY_PERIOD_S, QUERY_TIMEOUT_S = 1.0, 0.2
#: Time in which a rig file is read again, at most [s].
RELOAD_TIMEOUT_S = 30.0

#: Topics that one process of a rig publishes. Several may capture or record, but not the same sensor.
SOLE = (keys.health("run"), keys.health("track/*"), keys.model("*"))

_LEVELS: Mapping[ChildState, Level] = {
    ChildState.BACKOFF: Level.WARNING,
    ChildState.STALLED: Level.WARNING,
    ChildState.FAILED: Level.ERROR,
}


@dataclass(frozen=True, slots=True)
class Renewal:
    """The consequences of another configuration.

    Attributes:
        directory: folder of the recordings.
        children: all processes of the rig, not started.
        components: those that have to start, or to start again; one that the rig has not is ignored.
        ends: those that it had and has no longer.
    """

    directory: Path
    children: Sequence[Child]
    components: Sequence[str]
    ends: Sequence[str] = ()

    @property
    def starts(self) -> list[str]:
        """The components that start and that the rig has."""
        has = {child.component for child in self.children}
        return [component for component in self.components if component in has]


class RunSession:
    """Everything that `abs-service run` does between its start and its end.

    Args:
        bus: of the rig.
        rig: its name and places, for people to read.
        trackers: names of the trackers.
        supervisor: of the processes.
        display: shows the state.
        clock: time.
        watchers: see the state as often as the display does.
    """

    def __init__(
        self,
        bus: CheckedBus,
        rig: RigPlaces,
        trackers: Iterable[str],
        supervisor: Supervisor,
        display: Display,
        clock: WallClock,
        watchers: Sequence[Callable[[RigView], None]] = (),
    ) -> None:
        self._bus = bus
        self._rig = rig
        self._supervisor = supervisor
        self._display = display
        self._clock = clock
        self._watchers = watchers
        self._renewals: SimpleQueue[Renewal] = SimpleQueue()
        self._begin_ns = self._queried_ns = clock.monotonic()
        trackers = tuple(trackers)
        self._silence = TrackerSilence(trackers, clock.monotonic)
        self._live = rig_state.RigState(trackers, clock.monotonic)
        self._headers = HeaderFactory(rig.name, clock)
        self._health = Health(bus, "run", self._headers)
        bus.declare_liveliness("run")
        self._pools = EndedPools(clock.monotonic)
        self._publishers = SolePublishers(bus, SOLE, clock.monotonic)
        self._inbox: LatestQueue[Sample] = LatestQueue(DEPTH)
        for pattern in rig_state.PATTERNS:
            bus.subscribe(pattern, lambda sample: self._inbox.put(sample.topic, sample))

    @property
    def elapsed_s(self) -> float:
        """Time since the start [s]."""
        return (self._clock.monotonic() - self._begin_ns) * 1e-9

    def answer_reloads(self, read: Callable[[], Renewal]) -> None:
        """Answers requests to read the rig file again.

        Args:
            read: reads it; raises RefusedError. Called from a thread of the transport.
        """

        def act() -> tuple[Sequence[str], Sequence[str]]:
            self._renewals.put(renewal := read())
            return renewal.starts, renewal.ends

        commands.answer_reload(self._bus, self._headers, self._health, act)

    def reload(self) -> None:
        """Asks itself to read the rig file again; the log has the answer."""
        commands.reload(self._bus, self._headers, RELOAD_TIMEOUT_S)

    def run_until(self, stop_requested: Callable[[], bool]) -> None:
        """Runs until `stop_requested` returns True or the supervisor has an exit code."""
        while not stop_requested() and self._supervisor.exit_code() is None:
            while not self._renewals.empty():
                self._renew(self._renewals.get())
            self._supervisor.poll()
            self._pools.update(self._supervisor.processes())
            self._report()
            self._silence.report(self._health)
            self._listen(PERIOD_S)
            self._request_missing_topologies()

    def stop(self) -> None:
        """Stops the processes in order, and processes their last messages."""

        def listen(seconds: float) -> None:
            # The processes have to be stopped even if the output is closed.
            with suppress(BrokenPipeError):
                self._listen(seconds)

        self._supervisor.stop(listen)
        listen(PERIOD_S)
        self._report()
        self._health.publish()

    def view(self) -> RigView:
        """Snapshot of the rig."""
        return RigView(
            rig=self._rig,
            live=self._live,
            children=tuple(self._supervisor.children.values()),
            elapsed_s=self.elapsed_s,
            now_ns=self._clock.monotonic(),
            host_clock=self._headers.host_clock,
            refused=self._bus.trouble,
            rivals=self._publishers.trouble,
            silent=self._silence.found,
        )

    def _listen(self, seconds: float) -> None:
        end_ns = self._clock.monotonic() + int(seconds * 1e9)
        while (remaining_ns := end_ns - self._clock.monotonic()) > 0:
            if (arrived := self._inbox.take(remaining_ns * 1e-9)) is None:
                break
            self._take(*arrived)
        view = self.view()
        self._display.update(view)
        for watch in self._watchers:
            watch(view)

    def _renew(self, renewal: Renewal) -> None:
        """Starts some processes again with another configuration; the others go on, capture with what it publishes."""
        self._rig = replace(self._rig, directory=renewal.directory)
        known = self._supervisor.children.keys()
        self._supervisor.exchange(renewal.children)
        names = [child.component for child in renewal.children if child.component.startswith("track/")]
        trackers = [name.removeprefix("track/") for name in names]
        self._live.follow(trackers)
        gone = self._silence.follow(trackers)
        for component in renewal.ends:
            self._health.label(f"{PROCESS}{component}", "")
        for topic in (*renewal.ends, *map(keys.state, gone)):
            self._health.report(topic, Level.OK)
        if "capture" in known - set(renewal.components):  # not if another host captures
            self._supervisor.children["capture"].process.wake()
        for component in [one for one in renewal.starts if one in known]:
            self._supervisor.renew(component)
            self._silence.restart(component.removeprefix("track/"))

    def _request_missing_topologies(self) -> None:
        """Queries topologies that the network dropped: each is sent once, and errors cannot be computed without."""
        if self._clock.monotonic() - self._queried_ns < QUERY_PERIOD_S * 1e9:
            return
        self._queried_ns = self._clock.monotonic()
        for tracker in self._live.missing_topologies():
            for sample in self._bus.query(keys.topology(tracker), QUERY_TIMEOUT_S):
                self._take(sample.topic, sample)

    def _take(self, topic: str, sample: Sample) -> None:
        for report in self._live.take(sample):
            self._display.estimate(report)
        self._silence.received(topic)
        if topic.startswith("health/"):
            component = topic.removeprefix("health/")
            self._supervisor.heartbeat(component, busy=self._live.prepares(component))

    def _report(self) -> None:
        for child in self._supervisor.children.values():
            self._health.count_up_to({f"restarts.{child.component}": child.restarts})
            starved = child.state is ChildState.RUNNING and child.reason
            level = Level.ERROR if child.lacks else Level.WARNING if starved else _LEVELS.get(child.state, Level.OK)
            self._health.report(child.component, level, f"{child.component} {child.condition}" if child.reason else "")
            self._health.label(f"{PROCESS}{child.component}", child.condition)
        self._health.count_up_to({"malformed": self._live.malformed, "not_shown": sum(self._inbox.dropped.values())})
        if self._health.due():
            self._bus.report(self._health)
            view = self.view()
            for topic, trouble in ("publishers", view.rivals), ("host that captures", view.capture_silence):
                self._health.report(topic, Level.ERROR if trouble else Level.OK, trouble)
        self._health.tick()
