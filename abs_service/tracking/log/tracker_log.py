"""Log of one tracker: estimates, errors where ground truth is known, and statistics."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from numpy.typing import NDArray

from abs_service.tracking.log.sensor_shares import SensorShares, known
from abs_service.tracking.log.truth import TruthComparison, rms_sigma_mm


@dataclass(frozen=True)
class EstimateReport:
    """One estimate for displays and scripts; None where a value is unknown.

    Attributes:
        tracker: who made it.
        seq: counts the tracker's estimates.
        stamp: wall-clock time of the exposure, RFC 3339.
        status: INITIALIZING, TRACKING, DEGRADED or LOST.
        reasons: why it is not TRACKING.
        warnings: doubts about the object that was detected.
        theta: parameters of the deformation, SI units.
        error_mm: mean distance of the vertices from where they truly are [mm].
        surface_mm: mean distance of the vertices from the true surface [mm].
        vertex_sigma_mm: root mean square of the vertex errors that the tracker expects [mm]; needs no truth.
        solve_ms: from the frame set to theta [ms].
        age_ms: from the exposure to the publication [ms]; None offline.
        generations, evaluations: of the search.
        skipped: frame sets passed over before this one.
        derived: numbers that follow from the first image unless a key gives them, by their key in the rig file.
        shares: what every sensor that contributed shows of the vertices.
    """

    tracker: str
    seq: int
    stamp: str
    status: str
    reasons: tuple[str, ...]
    warnings: tuple[str, ...]
    theta: tuple[float, ...]
    error_mm: float | None
    surface_mm: float | None
    vertex_sigma_mm: float | None
    solve_ms: float
    age_ms: float | None
    generations: int
    evaluations: int
    skipped: int
    derived: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    shares: Mapping[str, SensorShares] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


@dataclass
class RunningStats:
    """Running mean and maximum."""

    count: int = 0
    sum: float = 0.0
    max: float = 0.0

    def add(self, value: float | None) -> None:
        """Adds a value; None is ignored."""
        if value is not None:
            self.count, self.sum, self.max = self.count + 1, self.sum + value, max(self.max, value)

    @property
    def mean(self) -> float:
        """The mean; NaN of nothing."""
        return self.sum / self.count if self.count else float("nan")


class TrackerLog:
    """Log of one tracker.

    Attributes:
        last: its last estimate.
        estimates, skipped: how many estimates it made, and how many frame sets it passed over.
        error_mm, surface_mm, solve_ms: totals over all estimates.
        exposure_ns: exposure of every sensor that it used last, on the clock `host_clock` [ns].
        host_clock: which host's clock that is, see `drivers.contract.host_clock`.
        truth: ground truth for the errors.
    """

    def __init__(self) -> None:
        self.last: EstimateReport | None = None
        self.estimates = 0
        self.statuses: Counter[str] = Counter()
        self.skipped = 0
        self.error_mm, self.surface_mm, self.solve_ms = RunningStats(), RunningStats(), RunningStats()
        self.exposure_ns: dict[str, int] = {}
        self.host_clock = ""
        self.truth = TruthComparison()
        self._pending: DeformationState | None = None
        self._mesh: DeformedMesh | None = None
        self._estimate_mesh: tuple[str, int] | None = None  # which mesh the last estimate is of,
        self._topology_mesh: tuple[str, int] | None = None  # and the last topology

    @property
    def has_tracked(self) -> bool:
        """True if an estimate was of use: TRACKING or DEGRADED."""
        return bool(self.statuses["TRACKING"] + self.statuses["DEGRADED"])

    @property
    def lacks_topology(self) -> bool:
        """True if the topology of the last estimate did not arrive."""
        return self._estimate_mesh != self._topology_mesh

    def take_topology(self, topology: MeshTopology) -> None:
        """Takes the mesh at rest; the same one may come again."""
        which = (topology.header.boot_id, topology.mesh_version)
        if which != self._topology_mesh:
            self._topology_mesh = which
            self.truth.add_topology(points(topology.rest_vertices_f32), topology.header.t_host_ns)

    def take_state(self, state: DeformationState) -> Iterator[EstimateReport]:
        """Takes an estimate; it is reported when its mesh has come, or at the latest with the next estimate."""
        if self._pending is not None:
            yield self._report(self._pending, DeformedMesh())
        self.host_clock = state.header.host_clock
        self._pending, self._estimate_mesh = state, (state.header.boot_id, state.mesh_version)
        self.exposure_ns.update({sensor.sensor: sensor.t_host_ns for sensor in state.sensors if not sensor.missing})
        yield from self._pair()

    def take_mesh(self, mesh: DeformedMesh) -> Iterator[EstimateReport]:
        """Takes the deformed vertices of an estimate, which may come before or after it."""
        self._mesh = mesh
        yield from self._pair()

    def _pair(self) -> Iterator[EstimateReport]:
        state, mesh = self._pending, self._mesh
        if state is not None and mesh is not None and state.header.t_host_ns == mesh.header.t_host_ns:
            self._pending = self._mesh = None
            yield self._report(state, mesh)

    def summary(self) -> list[str]:
        """Summary in one to four lines."""
        line = f"{self.estimates} estimates, {self.skipped} frame sets skipped"
        if self.estimates:
            line += f", {self.solve_ms.mean:.1f} ms each"
            line += ", " + ", ".join(f"{number} {status}" for status, number in self.statuses.most_common())
        lines = [line]
        if self.last and self.last.reasons:
            lines.append(f"{self.last.status} at the end: {'; '.join(self.last.reasons)}")
        if not self.has_tracked:
            lines.append("nothing was tracked")
        error, surface = self.error_mm, self.surface_mm
        if error.count:
            lines.append(
                f"vertex error mean {error.mean:.2f} mm, max {error.max:.2f} mm; "
                f"surface error mean {surface.mean:.2f} mm, max {surface.max:.2f} mm"
            )
        return lines

    def _report(self, state: DeformationState, mesh: DeformedMesh) -> EstimateReport:
        errors = self.truth.compare(state.header.t_host_ns, points(mesh.vertices_f32))
        report = EstimateReport(
            tracker=state.tracker,
            seq=state.header.seq,
            stamp=state.header.stamp.ToJsonString(),
            status=DeformationState.Status.Name(state.status).removeprefix("STATUS_"),
            reasons=tuple(state.reasons),
            warnings=tuple(state.warnings),
            theta=tuple(state.theta),
            error_mm=known(errors.vertex_mm) if errors else None,
            surface_mm=known(errors.surface_mm) if errors else None,
            vertex_sigma_mm=known(rms_sigma_mm(mesh.covariance_f32)),
            solve_ms=state.solve_ms,
            age_ms=known(state.age_ms),
            generations=state.generations,
            evaluations=state.evaluations,
            skipped=state.skipped,
            derived={key: tuple(numbers.values) for key, numbers in state.derived.items()},
            shares={one.sensor: SensorShares.of(one) for one in state.sensors if not one.missing},
        )
        self.last, self.estimates, self.skipped = report, self.estimates + 1, self.skipped + report.skipped
        self.statuses[report.status] += 1
        self.error_mm.add(report.error_mm)
        self.surface_mm.add(report.surface_mm)
        self.solve_ms.add(report.solve_ms)
        return report


def points(xyz_f32: bytes) -> NDArray[np.float32]:
    """Points (n, 3) as messages carry them."""
    return np.frombuffer(xyz_f32, "<f4").reshape(-1, 3)
