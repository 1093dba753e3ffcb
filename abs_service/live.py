"""What a running rig said lately, gathered from its messages for people and scripts to read."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from abs.v1.deformation_state_pb2 import DeformationState
from abs.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from abs.v1.health_pb2 import Health
from abs.v1.surface_truth_pb2 import SurfaceTruth
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from abs_service import keys
from abs_service.bus.contract import Sample
from abs_service.evaluation import TruthComparison, expected_mm

#: The topics that `Live.take` understands.
PATTERNS = ("health/**", keys.state("*"), keys.mesh("*"), keys.topology("*"), keys.truth("*"))


@dataclass(frozen=True)
class Report:
    """One estimate as people and scripts see it; None where something is not known.

    Attributes:
        tracker: who made it.
        seq: counts the tracker's estimates.
        stamp: wall-clock time of the exposure, RFC 3339.
        status: INITIALIZING, TRACKING, DEGRADED or LOST.
        reasons: why it is not TRACKING.
        theta: parameters of the deformation, SI units.
        error_mm: mean distance of the vertices from where they truly are [mm].
        surface_mm: mean distance of the vertices from the true surface [mm].
        vertex_sigma_mm: root mean square of the vertex errors that the tracker expects [mm]; needs no truth.
        solve_ms: from the frame set to theta [ms].
        age_ms: from the exposure to the publication [ms]; None offline.
        generations, evaluations: what the search needed.
        skipped: frame sets passed over before this one.
    """

    tracker: str
    seq: int
    stamp: str
    status: str
    reasons: tuple[str, ...]
    theta: tuple[float, ...]
    error_mm: float | None
    surface_mm: float | None
    vertex_sigma_mm: float | None
    solve_ms: float
    age_ms: float | None
    generations: int
    evaluations: int
    skipped: int

    def as_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


@dataclass
class Total:
    """Mean and maximum of numbers that come one by one."""

    count: int = 0
    sum: float = 0.0
    max: float = 0.0

    def add(self, value: float | None) -> None:
        """Takes one more; None, where nothing is known, changes nothing."""
        if value is not None:
            self.count, self.sum, self.max = self.count + 1, self.sum + value, max(self.max, value)

    @property
    def mean(self) -> float:
        """The mean; NaN of nothing."""
        return self.sum / self.count if self.count else float("nan")


class TrackerLog:
    """What one tracker said.

    Attributes:
        last: its last estimate.
        estimates, skipped: how many estimates it made, and how many frame sets it passed over.
        error_mm, surface_mm, solve_ms: totals over all estimates.
        seen_ns: exposure of every sensor that it used last, CLOCK_MONOTONIC [ns].
        truth: what the errors are measured against.
    """

    def __init__(self) -> None:
        self.last: Report | None = None
        self.estimates = 0
        self.statuses: Counter[str] = Counter()
        self.skipped = 0
        self.error_mm, self.surface_mm, self.solve_ms = Total(), Total(), Total()
        self.seen_ns: dict[str, int] = {}
        self.truth = TruthComparison()
        self._pending: DeformationState | None = None
        self._mesh: DeformedMesh | None = None

    def take_state(self, state: DeformationState) -> Iterator[Report]:
        """Takes an estimate; it is reported when its mesh has come, or at the latest with the next estimate."""
        if self._pending is not None:
            yield self._report(self._pending, DeformedMesh())
        self._pending = state
        self.seen_ns.update({sensor.sensor: sensor.t_host_ns for sensor in state.sensors if not sensor.missing})
        yield from self._pair()

    def take_mesh(self, mesh: DeformedMesh) -> Iterator[Report]:
        """Takes the deformed vertices of an estimate, which may come before or after it."""
        self._mesh = mesh
        yield from self._pair()

    def _pair(self) -> Iterator[Report]:
        state, mesh = self._pending, self._mesh
        if state is not None and mesh is not None and state.header.t_host_ns == mesh.header.t_host_ns:
            self._pending = self._mesh = None
            yield self._report(state, mesh)

    def summary(self) -> list[str]:
        """What it did so far, in a line or two."""
        line = f"{self.estimates} estimates, {self.skipped} frame sets skipped"
        if self.estimates:
            line += f", {self.solve_ms.mean:.1f} ms each"
            line += ", " + ", ".join(f"{number} {status}" for status, number in self.statuses.most_common())
        error, surface = self.error_mm, self.surface_mm
        if not error.count:
            return [line]
        return [
            line,
            f"vertex error mean {error.mean:.2f} mm, max {error.max:.2f} mm; "
            f"surface error mean {surface.mean:.2f} mm, max {surface.max:.2f} mm",
        ]

    def _report(self, state: DeformationState, mesh: DeformedMesh) -> Report:
        errors = self.truth.compare(state.header.t_host_ns, _points(mesh.vertices_f32))
        report = Report(
            tracker=state.tracker,
            seq=state.header.seq,
            stamp=state.header.stamp.ToJsonString(),
            status=DeformationState.Status.Name(state.status).removeprefix("STATUS_"),
            reasons=tuple(state.reasons),
            theta=tuple(state.theta),
            error_mm=errors.vertex_mm if errors else None,
            surface_mm=errors.surface_mm if errors else None,
            vertex_sigma_mm=expected_mm(mesh.covariance_f32),
            solve_ms=state.solve_ms,
            age_ms=None if math.isnan(state.age_ms) else state.age_ms,
            generations=state.generations,
            evaluations=state.evaluations,
            skipped=state.skipped,
        )
        self.last, self.estimates, self.skipped = report, self.estimates + 1, self.skipped + report.skipped
        self.statuses[report.status] += 1
        self.error_mm.add(report.error_mm)
        self.surface_mm.add(report.surface_mm)
        self.solve_ms.add(report.solve_ms)
        return report


@dataclass(frozen=True)
class Heard:
    """The last health of a component, when it came, CLOCK_MONOTONIC [ns], and the one before."""

    health: Health = field(default_factory=Health)
    t_ns: int = 0
    before: "Heard | None" = None

    def rate(self, gauge: str) -> float:
        """How fast a gauge grew lately, per second; 0 if it shrank, as a file's size does when a new one begins."""
        if self.before is None or self.t_ns <= self.before.t_ns:
            return 0.0
        growth = self.health.gauges.get(gauge, 0.0) - self.before.health.gauges.get(gauge, 0.0)
        return max(growth, 0.0) * 1e9 / (self.t_ns - self.before.t_ns)


class Live:
    """The present of a rig. Not for several threads.

    Args:
        trackers: their names.
        clock: monotonic time [ns].

    Attributes:
        trackers: what each of them said.
        heard: health by component.
        garbled: messages that could not be read.
    """

    def __init__(self, trackers: Iterable[str], clock: Callable[[], int]) -> None:
        self.trackers = {name: TrackerLog() for name in trackers}
        self.heard: dict[str, Heard] = {}
        self.garbled = 0
        self._clock = clock

    def take(self, sample: Sample) -> list[Report]:
        """Takes one message and returns the estimates that it completes; counts messages that cannot be read."""
        try:
            return self._take(sample)
        except (DecodeError, ValueError):
            self.garbled += 1
            return []

    def _take(self, sample: Sample) -> list[Report]:
        if sample.message == Health.DESCRIPTOR.full_name:
            health = Health.FromString(sample.payload)
            before = replace(self.heard.get(health.component, Heard()), before=None)
            self.heard[health.component] = Heard(health, self._clock(), before if before.t_ns else None)
        elif sample.message == SurfaceTruth.DESCRIPTOR.full_name:
            self._take_truth(SurfaceTruth.FromString(sample.payload))
        elif (tracker := self.trackers.get(sample.topic.partition("/")[0])) is not None:
            return list(_take_from(tracker, sample))
        return []

    def health(self, component: str) -> Health:
        """What a component said last; empty if it said nothing yet."""
        return self.heard.get(component, Heard()).health

    def preparing(self) -> bool:
        """Whether a tracker is compiling its kernels, or loading those that it compiled once."""
        return any(self.health(f"track/{name}").labels.get("phase") == "preparing" for name in self.trackers)

    def _take_truth(self, truth: SurfaceTruth) -> None:
        points_r = _points(truth.points_f32).reshape(truth.rows, truth.columns, 3)
        for tracker in self.trackers.values():
            tracker.truth.add_truth(truth.header.t_host_ns, points_r, truth.surface)


def _take_from(tracker: TrackerLog, sample: Sample) -> Iterator[Report]:
    if sample.message == DeformationState.DESCRIPTOR.full_name:
        yield from tracker.take_state(DeformationState.FromString(sample.payload))
    elif sample.message == DeformedMesh.DESCRIPTOR.full_name:
        yield from tracker.take_mesh(DeformedMesh.FromString(sample.payload))
    elif sample.message == MeshTopology.DESCRIPTOR.full_name:
        topology = MeshTopology.FromString(sample.payload)
        tracker.truth.add_topology(_points(topology.rest_vertices_f32), topology.header.t_host_ns)


def _points(xyz_f32: bytes) -> NDArray[np.float32]:
    return np.frombuffer(xyz_f32, "<f4").reshape(-1, 3)
