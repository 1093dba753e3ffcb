"""Errors of tracked frames by exposure, so that a live run can be compared with a replay of the same exposures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from numpy.typing import NDArray

from abs_service.bus import keys
from abs_service.recording.recording_file import ESTIMATES
from abs_service.tracking.log.truth import TruthComparison
from evaluation.service.frame_budget.rig import TRACKER
from evaluation.service.messages import recorded_messages

#: Positions (rows, columns, 3) [m] of the true surface at an exposure.
Truth = Callable[[int], NDArray[np.float32]]


@dataclass(frozen=True, slots=True, eq=False)
class TrackedFrame:
    """Estimate of one exposure.

    Attributes:
        is_tracking: True if its status is TRACKING.
        vertices: (n, 3) [m].
        rest: vertices of the undeformed mesh (n, 3) [m].
        made: exposure that the mesh was made from.
    """

    is_tracking: bool
    vertices: NDArray[np.floating]
    rest: NDArray[np.floating]
    made: int


def vertex_errors(frames: Mapping[int, TrackedFrame], truth: Truth) -> dict[int, float]:
    """Mean vertex error [mm] of the frames by exposure; those whose mesh was made before the first are left out."""
    found: dict[int, float] = {}
    comparison, made = TruthComparison(), -1
    for k, frame in sorted(frames.items()):
        comparison.add_truth(k, truth(k))
        if frame.made != made:
            made = frame.made
            comparison.add_truth(made, truth(made))
            comparison.add_topology(frame.rest, made)
        errors = comparison.compare(k, frame.vertices)
        if errors is not None:
            found[k] = errors.vertex_mm
    return found


def recorded(folder: Path, head: str) -> dict[int, TrackedFrame]:
    """Frames that the service recorded, by exposure of the depth head.

    Args:
        folder: with the recordings of one run and the files of their estimates.
        head: the depth head.
    """
    states: dict[int, DeformationState] = {}
    meshes: dict[int, DeformedMesh] = {}
    topologies: dict[int, MeshTopology] = {}
    places = _places(states, meshes, topologies)
    for topic, message in recorded_messages(folder, places, ESTIMATES):
        places[topic](message.data)
    exposures = {t: k for t, state in states.items() for k in _exposure(state, head)}
    return {
        exposures[t]: TrackedFrame(
            states[t].status == DeformationState.STATUS_TRACKING,
            _points(mesh.vertices_f32),
            _points(topology.rest_vertices_f32),
            exposures[topology.header.t_host_ns],
        )
        for t, mesh in meshes.items()
        if t in exposures
        and (topology := topologies.get(mesh.mesh_version)) is not None
        and topology.header.t_host_ns in exposures
    }


def _places(
    states: dict[int, DeformationState], meshes: dict[int, DeformedMesh], topologies: dict[int, MeshTopology]
) -> dict[str, Callable[[bytes], None]]:
    """Functions that take the messages of a topic, by topic."""

    def take_state(data: bytes) -> None:
        state = DeformationState.FromString(data)
        states[state.header.t_host_ns] = state

    def take_mesh(data: bytes) -> None:
        mesh = DeformedMesh.FromString(data)
        meshes[mesh.header.t_host_ns] = mesh

    def take_topology(data: bytes) -> None:
        topology = MeshTopology.FromString(data)
        topologies[topology.mesh_version] = topology

    return {keys.state(TRACKER): take_state, keys.mesh(TRACKER): take_mesh, keys.topology(TRACKER): take_topology}


def _exposure(state: DeformationState, head: str) -> list[int]:
    return [sensor.seq for sensor in state.sensors if sensor.sensor == head and not sensor.missing]


def _points(data: bytes) -> NDArray[np.float32]:
    return np.frombuffer(data, "<f4").reshape(-1, 3)
