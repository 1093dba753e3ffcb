"""Estimates out of the messages of a recording."""

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from abs_service.api.estimate import Estimate
from abs_service.tracker.estimates.estimate import Status
from drivers.replay.contents import Contents, RecordingError
from drivers.replay.messages import messages

_STATE, _MESH, _TOPOLOGY = (one.DESCRIPTOR.full_name for one in (DeformationState, DeformedMesh, MeshTopology))


def trackers(contents: Contents) -> tuple[str, ...]:
    """Names of the trackers with estimates in a file."""
    topics = (topic for topic in contents.topics.values() if topic.schema == _STATE and topic.count)
    return tuple(sorted(topic.name.split("/")[1] for topic in topics))


def estimates(path: Path, contents: Contents, tracker: str) -> Iterator[Estimate]:
    """Estimates of one tracker in the order of their times.

    Raises:
        RecordingError: a damaged part, or what is no estimate.
    """
    try:
        yield from _estimates(path, contents, tracker)
    except (DecodeError, ValueError) as error:
        raise RecordingError(f"{path}: an estimate of {tracker} is malformed: {error}") from error


def _estimates(path: Path, contents: Contents, tracker: str) -> Iterator[Estimate]:
    topologies: dict[tuple[str, int], MeshTopology] = {}
    own = (
        (topic.schema, message)
        for topic, message in messages(path, contents, {_STATE, _MESH, _TOPOLOGY})
        if topic.name.split("/")[1] == tracker
    )
    # An estimate, its mesh and, if it is the mesh's first, its topology have the time of the exposure.
    for _, group in groupby(own, key=lambda item: item[1].log_time):
        states: list[DeformationState] = []
        meshes: dict[int, DeformedMesh] = {}
        for schema, message in group:
            if schema == _STATE:
                states.append(DeformationState.FromString(message.data))
            elif schema == _MESH:
                mesh = DeformedMesh.FromString(message.data)
                meshes[mesh.header.seq] = mesh
            else:
                topology = MeshTopology.FromString(message.data)
                topologies[topology.header.boot_id, topology.mesh_version] = topology
        for state in states:
            topology = topologies.get((state.header.boot_id, state.mesh_version), MeshTopology())
            yield _estimate(state, meshes.get(state.header.seq, DeformedMesh()), topology)


def _estimate(state: DeformationState, mesh: DeformedMesh, topology: MeshTopology) -> Estimate:
    vertices = np.frombuffer(mesh.vertices_f32, "<f4").reshape(-1, 3)
    return Estimate(
        time_s=state.header.t_host_ns * 1e-9,
        status=Status(DeformationState.Status.Name(state.status).removeprefix("STATUS_")),
        reasons=tuple(state.reasons),
        theta=np.array(state.theta),
        covariance=_covariance(state),
        vertices=vertices,
        vertex_covariance=_vertex_covariance(mesh.covariance_f32, len(vertices)),
        faces=np.frombuffer(topology.faces_u32, "<u4").astype(np.int32).reshape(-1, 3),
        undeformed=np.frombuffer(topology.rest_vertices_f32, "<f4").astype(np.float64).reshape(-1, 3),
        mesh_version=state.mesh_version,
        inlier_share=state.inlier_share,
        residuals={one.sensor: one.normalized_residual for one in state.sensors if not one.missing},
        evaluations=state.evaluations,
        missing=tuple(one.sensor for one in state.sensors if one.missing),
        warnings=tuple(state.warnings),
    )


def _covariance(state: DeformationState) -> NDArray[np.float64]:
    """Covariance of theta (dim, dim) from its upper triangle; NaN where it is unknown."""
    full = np.full((len(state.theta), len(state.theta)), np.nan)
    if state.covariance_valid:
        rows, columns = np.triu_indices(len(full))
        full[rows, columns] = full[columns, rows] = state.covariance
    return full


def _vertex_covariance(six_f32: bytes, vertices: int) -> NDArray[np.float64]:
    """Covariances (n, 3, 3) from the six different entries of each; NaN where they are unknown."""
    full = np.full((vertices, 3, 3), np.nan)
    if six_f32:
        rows, columns = np.triu_indices(3)
        full[:, rows, columns] = full[:, columns, rows] = np.frombuffer(six_f32, "<f4").reshape(-1, 6)
    return full
