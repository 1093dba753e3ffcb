"""Joins the messages of one estimate: its state, its vertices, and the topology of the mesh that these belong to."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

#: Messages that may wait for the others of their estimate, and topologies that are kept.
KEPT = 16

T = TypeVar("T")
#: A tracker that is started again counts from 0 again, so every number is only known with its process.
Numbered = tuple[str, int]


@dataclass(frozen=True)
class CompleteEstimate:
    """The messages of one estimate, and when the last of them arrived on this host's monotonic clock [ns]."""

    state: DeformationState
    mesh: DeformedMesh
    topology: MeshTopology
    arrived_ns: int


class Assembly:
    """Keeps the newest whole estimate until it is taken; older ones, and those that stay incomplete, are given up.

    May be called from several threads.

    Args:
        clock: this host's monotonic clock [ns].

    Attributes:
        lacks_topology: True while the newest vertices wait for their topology.
    """

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._states: OrderedDict[Numbered, DeformationState] = OrderedDict()
        self._meshes: OrderedDict[Numbered, DeformedMesh] = OrderedDict()
        self._topologies: OrderedDict[Numbered, MeshTopology] = OrderedDict()
        self._newest: CompleteEstimate | None = None
        self._last: Numbered = ("", -1)
        self.lacks_topology = False

    def add_state(self, state: DeformationState) -> None:
        """Takes a state that has arrived."""
        self._add(self._states, _number(state.header), state)

    def add_mesh(self, mesh: DeformedMesh) -> None:
        """Vertices have arrived."""
        self._add(self._meshes, _number(mesh.header), mesh)

    def add_topology(self, topology: MeshTopology) -> None:
        """Takes a topology that has arrived; it may complete what waits."""
        with self._lock:
            _keep(self._topologies, (topology.header.boot_id, topology.mesh_version), topology)
            for number in list(self._states):
                self._complete(number)

    def take(self) -> CompleteEstimate | None:
        """The newest estimate that is whole, once."""
        with self._lock:
            newest, self._newest = self._newest, None
            return newest

    def _add(self, waiting: OrderedDict[Numbered, T], number: Numbered, message: T) -> None:
        with self._lock:
            if number[0] == self._last[0] and number[1] <= self._last[1]:
                return  # overtaken
            _keep(waiting, number, message)
            self._complete(number)

    def _complete(self, number: Numbered) -> None:
        """Joins an estimate if all of it is there."""
        state, mesh = self._states.get(number), self._meshes.get(number)
        if state is None or mesh is None:
            return
        topology = self._topologies.get((number[0], mesh.mesh_version))
        self.lacks_topology = topology is None and bool(mesh.vertices_f32)
        if self.lacks_topology or (topology and len(topology.rest_vertices_f32) != len(mesh.vertices_f32)):
            return
        self._newest = CompleteEstimate(state, mesh, topology or MeshTopology(), self._clock())
        self._last = number
        for waiting in (self._states, self._meshes):
            for other in [one for one in waiting if one[0] != number[0] or one[1] <= number[1]]:
                del waiting[other]


def _number(header: Header) -> Numbered:
    return header.boot_id, header.seq


def _keep(kept: OrderedDict[Numbered, T], number: Numbered, message: T) -> None:
    kept[number] = message
    if len(kept) > KEPT:
        kept.popitem(last=False)
