"""Current state of a running rig, collected from its messages."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.health_pb2 import Health
from absmsg.v1.surface_truth_pb2 import SurfaceTruth
from google.protobuf.message import DecodeError

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.tracking.log.tracker_log import EstimateReport, TrackerLog, points

#: The topics that `RigState.take` understands.
PATTERNS = ("health/**", keys.state("*"), keys.mesh("*"), keys.topology("*"), keys.truth("*"))


#: Processes of a component whose counters are kept apart.
PROCESSES = 16


@dataclass(frozen=True)
class Received:
    """Last health of a component, its arrival, CLOCK_MONOTONIC [ns], and the health before it."""

    health: Health = field(default_factory=Health)
    t_ns: int = 0
    previous: "Received | None" = None

    def rate(self, gauge: str) -> float:
        """Rate of a gauge between the last two messages [1/s]; 0 if it fell, as a file's size does on rotation."""
        if self.previous is None or self.t_ns <= self.previous.t_ns:
            return 0.0
        growth = self.health.gauges.get(gauge, 0.0) - self.previous.health.gauges.get(gauge, 0.0)
        return max(growth, 0.0) * 1e9 / (self.t_ns - self.previous.t_ns)


class RigState:
    """Current state of a rig. Not thread-safe."""

    def __init__(self, trackers: Iterable[str], clock: Callable[[], int]) -> None:
        self.trackers = {name: TrackerLog() for name in trackers}
        self.received: dict[str, Received] = {}
        self.malformed = 0
        self._removed: frozenset[str] = frozenset()  # components, whose last words come later
        # Counters by component and process, the one received last at the end; and those of silent processes.
        self._counted: defaultdict[str, dict[str, Mapping[str, int]]] = defaultdict(dict)
        self._ended: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self._clock = clock

    def follow(self, trackers: Iterable[str]) -> None:
        """Goes on with other trackers; those that there were before keep their logs."""
        names, before = tuple(trackers), self.trackers
        self.trackers = {name: before.get(name) or TrackerLog() for name in names}
        now, gone = ({f"track/{name}" for name in some} for some in (names, before.keys() - set(names)))
        self._removed = (self._removed | gone) - now
        for component in gone:
            self.received.pop(component, None)

    def take(self, sample: Sample) -> list[EstimateReport]:
        """Processes one message and returns the estimates that it completes; counts malformed messages."""
        try:
            return self._take(sample)
        except (DecodeError, ValueError):
            self.malformed += 1
            return []

    def _take(self, sample: Sample) -> list[EstimateReport]:
        if sample.message == Health.DESCRIPTOR.full_name:
            health = Health.FromString(sample.payload)
            if health.component in self._removed:
                return []
            self._count(health)
            previous = replace(self.received.get(health.component, Received()), previous=None)
            self.received[health.component] = Received(health, self._clock(), previous if previous.t_ns else None)
        elif sample.message == SurfaceTruth.DESCRIPTOR.full_name:
            self._take_truth(SurfaceTruth.FromString(sample.payload))
        elif (tracker := self.trackers.get(sample.topic.partition("/")[0])) is not None:
            return list(_take_from(tracker, sample))
        return []

    def health(self, component: str) -> Health:
        """Last health of a component; empty if there is none yet."""
        return self.received.get(component, Received()).health

    def counters(self, component: str) -> Counter[str]:
        """Counters of a component, of all its processes together.

        Each one that is started again counts from zero; several may live at once, as recorders of two hosts do.
        """
        total = Counter(self._ended[component])
        for counters in self._counted[component].values():
            total.update(counters)
        return total

    def preparing(self) -> bool:
        """True if a tracker is compiling its kernels, or loading them from the cache."""
        return any(self.prepares(f"track/{name}") for name in self.trackers)

    def prepares(self, component: str) -> bool:
        """`preparing` of one component."""
        return self.health(component).labels.get("phase") == "preparing"

    def compiled(self) -> str:
        """Progress of the compilation of kernels, by tracker; "" if none has to be compiled."""
        labels = {name: self.health(f"track/{name}").labels.get("kernels", "") for name in self.trackers}
        return "; ".join(f"{name} {label}" for name, label in labels.items() if label)

    def missing_topologies(self) -> list[str]:
        """Trackers whose topology was lost and has to be queried."""
        return [name for name, tracker in self.trackers.items() if tracker.lacks_topology]

    def _count(self, health: Health) -> None:
        processes = self._counted[health.component]
        processes.pop(health.header.boot_id, None)
        processes[health.header.boot_id] = dict(health.counters)
        if len(processes) > PROCESSES:
            self._ended[health.component].update(processes.pop(next(iter(processes))))

    def _take_truth(self, truth: SurfaceTruth) -> None:
        points_r = points(truth.points_f32).reshape(truth.rows, truth.columns, 3)
        for tracker in self.trackers.values():
            tracker.truth.add_truth(truth.header.t_host_ns, points_r, truth.surface)


def _take_from(tracker: TrackerLog, sample: Sample) -> Iterator[EstimateReport]:
    if sample.message == DeformationState.DESCRIPTOR.full_name:
        yield from tracker.take_state(DeformationState.FromString(sample.payload))
    elif sample.message == DeformedMesh.DESCRIPTOR.full_name:
        yield from tracker.take_mesh(DeformedMesh.FromString(sample.payload))
    elif sample.message == MeshTopology.DESCRIPTOR.full_name:
        tracker.take_topology(MeshTopology.FromString(sample.payload))
