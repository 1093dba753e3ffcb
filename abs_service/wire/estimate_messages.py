"""Messages of a tracker: estimates, mesh and topology."""

import functools
import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from absmsg.v1 import common_pb2, deformation_state_pb2, deformed_mesh_pb2
from absmsg.v1.sensor_model_pb2 import NumberList
from numpy.typing import NDArray

from abs_service.pairing.observation import Source
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import DeformationModel, HasVertexBasis
from abs_service.tracker.optimizers.base import Stop

State = deformation_state_pb2.DeformationState

STATE = State.DESCRIPTOR.full_name
MESH = deformed_mesh_pb2.DeformedMesh.DESCRIPTOR.full_name
COMPACT = deformation_state_pb2.CompactState.DESCRIPTOR.full_name
TOPOLOGY = deformed_mesh_pb2.MeshTopology.DESCRIPTOR.full_name

#: Most numbers in each table of a basis, those of 16,000 vertices and cubic splines; larger ones are not sent.
MAX_BASIS = 1 << 18

_STOP = {
    Stop.NOTHING: State.STOP_UNSPECIFIED,
    Stop.CONVERGED: State.STOP_CONVERGED,
    Stop.GENERATIONS: State.STOP_GENERATIONS,
    Stop.EVALUATIONS: State.STOP_EVALUATIONS,
    Stop.TIME: State.STOP_TIME,
}


@dataclass(frozen=True, slots=True)
class Identity:
    """Tracker, model and calibration of an estimate.

    Attributes:
        tracker: name of the tracker.
        model: type of its deformation model.
        model_id: hash of model and mesh.
        calib_id: hash of the rig's calibration.
        mesh_version: counts the tracker's meshes.
        derived: numbers that follow from the first image unless a key gives them, by key.
    """

    tracker: str
    model: str
    model_id: str
    calib_id: str
    mesh_version: int
    derived: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Effort:
    """Computing time and losses of an estimate.

    Attributes:
        solve_ms: time from frame set to Θ [ms].
        budget_ms: time that the search was allowed [ms]; 0 if unlimited.
        age_ms, age_error_ms: time from exposure to now and its largest error [ms]; NaN if unknown.
        skipped: frame sets passed over since the last estimate.
        dropped: frames so far that are in no estimate, by sensor.
    """

    solve_ms: float
    budget_ms: float
    age_ms: float
    age_error_ms: float
    skipped: int
    dropped: Mapping[str, int]


def with_mesh(identity: Identity, mesh: Mesh, version: int, derived: Mapping[str, tuple[float, ...]]) -> Identity:
    """The identity with a new mesh; `model_id` is equal where Θ means the same: same model, same undeformed mesh."""
    digest = hashlib.sha256(identity.model.encode())
    digest.update(mesh.vertices.astype("<f8").tobytes())
    digest.update(mesh.faces.astype("<i4").tobytes())
    return replace(identity, model_id=digest.hexdigest()[:16], mesh_version=version, derived=derived)


def state(header: common_pb2.Header, estimate: Estimate, identity: Identity, effort: Effort) -> State:
    """An estimate as a message."""
    return State(
        header=header,
        tracker=identity.tracker,
        status=f"STATUS_{estimate.status}",
        reasons=estimate.reasons,
        model=identity.model,
        model_id=identity.model_id,
        calib_id=identity.calib_id,
        theta=estimate.theta.tolist(),
        log_likelihood=-estimate.search.cost,
        search_deviation=estimate.search.deviation,
        generations=estimate.search.generations,
        evaluations=estimate.search.evaluations,
        searcher=estimate.search.searcher,
        stop=_STOP[estimate.search.stop],
        budget_evaluations=estimate.search.limit,
        budget_ms=effort.budget_ms,
        solve_ms=effort.solve_ms,
        age_ms=effort.age_ms,
        age_error_ms=effort.age_error_ms,
        skipped=effort.skipped,
        mesh_version=identity.mesh_version,
        inlier_share=estimate.inlier_share,
        covariance=estimate.covariance.ravel()[_upper_of(len(estimate.theta))].tolist(),
        covariance_valid=_is_known(estimate),
        samples=sum(fit.samples for fit in estimate.fits),
        clock_sigma_ns=max((source.t_sigma_ns for source in estimate.sources.values()), default=0),
        sensors=_sensors(estimate, effort.dropped),
        stretch=estimate.shape.stretch,
        folded_share=estimate.shape.folded_share,
        deviation_m=estimate.shape.deviation_m,
        warnings=estimate.warnings,
        derived={key: NumberList(values=numbers) for key, numbers in identity.derived.items()},
    )


def _sensors(estimate: Estimate, dropped: Mapping[str, int]) -> Iterator[State.Sensor]:
    """Contribution of each sensor; missing sensors are marked."""
    for fit in estimate.fits:
        source = estimate.sources.get(fit.sensor, Source(0, 0))
        yield State.Sensor(
            sensor=fit.sensor,
            seq=source.seq,
            t_host_ns=source.t_host_ns,
            samples=fit.samples,
            visible=fit.visible,
            occluded=fit.occluded,
            mean_log_likelihood=fit.mean_log_likelihood,
            normalized_residual=fit.normalized_residual,
            dropped=dropped.get(fit.sensor, 0),
            rim_visible=fit.rim.visible,
            rim_outside=fit.rim.outside,
            rim_inside=fit.rim.inside,
            rim_occluded=fit.rim.occluded,
            agreeing_share=fit.counts.share("agreeing"),
            disagreeing_share=fit.counts.share("disagreeing"),
            no_return_share=fit.counts.share("missing"),
            occluder_share=fit.counts.share("behind_occluder"),
            self_occluded_share=fit.counts.share("behind_itself"),
            outside_share=fit.counts.share("outside"),
            unexplained_share=fit.remainder.share,
            unexplained_at_first=fit.remainder.at_first,
        )
    for sensor in estimate.missing:
        yield State.Sensor(sensor=sensor, missing=True, dropped=dropped.get(sensor, 0))


def mesh(header: common_pb2.Header, estimate: Estimate, identity: Identity) -> deformed_mesh_pb2.DeformedMesh:
    """The deformed vertices of an estimate as a message."""
    return deformed_mesh_pb2.DeformedMesh(
        header=header,
        tracker=identity.tracker,
        mesh_version=identity.mesh_version,
        vertices_f32=estimate.vertices.astype("<f4").tobytes(),
        covariance_f32=_upper(estimate.vertex_covariance) if _is_known(estimate) else b"",
        rim_classes_u8=next((fit.rim.classes for fit in estimate.fits if fit.rim.classes), b""),
    )


def topology(
    header: common_pb2.Header, undeformed: Mesh, identity: Identity, model: DeformationModel | None = None
) -> deformed_mesh_pb2.MeshTopology:
    """The undeformed mesh as a message, with the model's basis if it has one.

    The header has the time of the frames that it was made from.
    """
    colored = np.isfinite(undeformed.colors).any()
    colors = np.nan_to_num(undeformed.colors).astype(np.uint8).tobytes() if colored else b""
    return deformed_mesh_pb2.MeshTopology(
        header=header,
        tracker=identity.tracker,
        mesh_version=identity.mesh_version,
        rest_vertices_f32=undeformed.vertices.astype("<f4").tobytes(),
        faces_u32=undeformed.faces.astype("<u4").tobytes(),
        colors_u8=colors,
        basis=_basis(model) if isinstance(model, HasVertexBasis) else None,
    )


def _basis(model: HasVertexBasis) -> deformed_mesh_pb2.VertexBasis | None:
    basis = model.vertex_basis
    if basis.value.size > MAX_BASIS:
        return None
    return deformed_mesh_pb2.VertexBasis(
        support=basis.value.shape[1],
        control_points_u16=basis.control_points.astype("<u2").tobytes(),
        value_f32=basis.value.astype("<f4").tobytes(),
        along_u_f32=basis.along_u.astype("<f4").tobytes(),
        along_w_f32=basis.along_w.astype("<f4").tobytes(),
        offset_f32=model.offset.astype("<f4").tobytes(),
    )


def compact(state: State, offset: NDArray[np.floating]) -> deformation_state_pb2.CompactState:
    """The part of an estimate that goes over a slow link.

    Args:
        state: the estimate.
        offset: of the vertices along their normals (n,), if they are new [m]; (0,) if not.
    """
    return deformation_state_pb2.CompactState(
        header=state.header,
        tracker=state.tracker,
        status=state.status,
        mesh_version=state.mesh_version,
        theta_f32=np.array(state.theta, "<f4").tobytes(),
        deviation_m=state.deviation_m,
        age_ms=state.age_ms,
        offset_f32=offset.astype("<f4").tobytes(),
        reasons=state.reasons,
    )


def _is_known(estimate: Estimate) -> bool:
    """True if the covariances are valid, which they are not while the object is lost."""
    return estimate.status in (Status.TRACKING, Status.DEGRADED)


@functools.cache
def _upper_of(dimension: int) -> NDArray[np.intp]:
    """Places of the upper triangle's entries in a flattened matrix (dim, dim), row by row."""
    rows, columns = np.triu_indices(dimension)
    return rows * dimension + columns


def _upper(covariance: NDArray[np.float64]) -> bytes:
    """The six different entries of symmetric matrices (n, 3, 3), row by row."""
    return covariance.reshape(-1, 9)[:, _upper_of(3)].astype("<f4").tobytes()
