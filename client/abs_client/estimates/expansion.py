"""Vertices from theta, for models whose topology has a basis: a spline surface, and offsets along its normals."""

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace

import numpy as np
from absmsg.v1.deformation_state_pb2 import CompactState, DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology, VertexBasis
from numpy.typing import NDArray

from abs_client.errors import MalformedError
from abs_client.estimates.assembly import Assembly, Numbered

#: Meshes whose bases are kept.
KEPT = 2


@dataclass(frozen=True)
class Surface:
    """Vertices as a function of theta.

    Attributes:
        control_points: numbers (n, k) of the control points that each vertex depends on.
        tables: their weights in a vertex's point of the surface, and in its two tangents there (3, n, k).
        offset: of each vertex along its normal (n,) [m].
    """

    control_points: NDArray[np.uint16]
    tables: NDArray[np.float32]
    offset: NDArray[np.float32]

    def vertices(self, theta: NDArray[np.float32]) -> NDArray[np.float32]:
        """Vertices (n, 3) [m] for the control points theta (dim,): eq. 8 of the method.

        Raises:
            MalformedError: theta is not whole control points, or too few, or offsets are not as many as vertices.
        """
        count, rest = divmod(len(theta), 3)
        if rest or len(self.offset) != len(self.control_points) or self.control_points.max(initial=0) >= count:
            raise MalformedError(f"{len(theta)} parameters, or {len(self.offset)} offsets, do not fit the mesh")
        control = theta.reshape(-1, 3)[self.control_points]
        points, along_u, along_w = np.einsum("tnk,nkd->tnd", self.tables, control)
        normals = np.cross(along_u, along_w)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
        return points + self.offset[:, None] * normals


def surface_of(basis: VertexBasis) -> Surface:
    """The surface of a message."""
    shape = -1, basis.support
    tables = [
        np.frombuffer(one, "<f4").reshape(shape) for one in (basis.value_f32, basis.along_u_f32, basis.along_w_f32)
    ]
    control_points = np.frombuffer(basis.control_points_u16, "<u2").reshape(shape)
    return Surface(control_points, np.stack(tables), np.frombuffer(basis.offset_f32, "<f4"))


class Expansion:
    """Completes estimates of which theta arrives alone; those of models without a basis have no vertices.

    May be called from several threads.

    Args:
        assembly: takes the estimates.
    """

    def __init__(self, assembly: Assembly) -> None:
        self._assembly = assembly
        self._lock = threading.Lock()
        self._surfaces: OrderedDict[Numbered, Surface | None] = OrderedDict()
        self._waiting: CompactState | None = None

    def add_topology(self, topology: MeshTopology) -> None:
        """Takes a topology that has arrived; it may complete what waits."""
        surface = surface_of(topology.basis) if topology.HasField("basis") else None
        with self._lock:
            self._surfaces[topology.header.boot_id, topology.mesh_version] = surface
            if len(self._surfaces) > KEPT:
                self._surfaces.popitem(last=False)
            waiting, self._waiting = self._waiting, None
        if surface is not None:
            self._assembly.add_topology(topology)
        if waiting is not None:
            self.add_compact(waiting)

    def add_compact(self, compact: CompactState) -> None:
        """Takes a theta that has arrived.

        Raises:
            MalformedError: it is not of the mesh that it names.
        """
        theta, number = np.frombuffer(compact.theta_f32, "<f4"), (compact.header.boot_id, compact.mesh_version)
        with self._lock:
            if compact.mesh_version and number not in self._surfaces:
                self._waiting, self._assembly.lacks_topology = compact, True
                return
            self._assembly.lacks_topology = False
            surface = self._surfaces.get(number)
            if surface is not None and compact.offset_f32:
                surface = self._surfaces[number] = replace(surface, offset=np.frombuffer(compact.offset_f32, "<f4"))
        same = {"header": compact.header, "tracker": compact.tracker, "mesh_version": compact.mesh_version}
        vertices = b"" if surface is None else surface.vertices(theta).astype("<f4").tobytes()
        self._assembly.add_mesh(DeformedMesh(**same, vertices_f32=vertices))
        self._assembly.add_state(
            DeformationState(
                **same,
                status=compact.status,
                reasons=compact.reasons,
                theta=theta.tolist(),
                deviation_m=compact.deviation_m,
                age_ms=compact.age_ms,
            )
        )
