"""An estimate as a program wants it: status, arrays in SI units, and how well each is known."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from types import MappingProxyType

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from google.protobuf.message import Message
from numpy.typing import NDArray

_TRIANGLE = [0, 1, 2, 1, 3, 4, 2, 4, 5]
_SHARE = "_share"


class Status(StrEnum):
    """The tracker's judgement of an estimate, or STALE: this program's, of having no new one."""

    INITIALIZING = "INITIALIZING"
    TRACKING = "TRACKING"
    DEGRADED = "DEGRADED"
    LOST = "LOST"
    STALE = "STALE"


_STATUS = {
    DeformationState.STATUS_INITIALIZING: Status.INITIALIZING,
    DeformationState.STATUS_TRACKING: Status.TRACKING,
    DeformationState.STATUS_DEGRADED: Status.DEGRADED,
    DeformationState.STATUS_LOST: Status.LOST,
}


@dataclass(frozen=True)
class State:
    """An estimate with the mesh that belongs to it. Arrays are read-only and made when they are asked for.

    Attributes:
        message: the estimate as it was published; everything that has no name here is in it.
        mesh: its vertices as they were published.
        topology: of these vertices; an empty message before an object was found.
        status: TRACKING, DEGRADED: usable with care, LOST, INITIALIZING, or STALE: nothing new came.
        reasons: for every status but TRACKING, in plain words.
        age_s: from the exposure until this program was given the state [s]; NaN if nothing ever came. If the clock of
            the cameras' host is unknown, the least that it can be.
    """

    message: DeformationState
    mesh: DeformedMesh
    topology: MeshTopology
    status: Status
    reasons: tuple[str, ...]
    age_s: float

    @property
    def usable(self) -> bool:
        """True if it is TRACKING or DEGRADED."""
        return self.status in (Status.TRACKING, Status.DEGRADED)

    @property
    def t_host_ns(self) -> int:
        """Moment of the exposure on the monotonic clock of the cameras' host [ns]."""
        return self.message.header.t_host_ns

    @property
    def seq(self) -> int:
        """Counts the tracker's estimates from 0, anew when it is started again; gaps are those not given, or lost."""
        return self.message.header.seq

    @property
    def mesh_version(self) -> int:
        """Counts the tracker's meshes: vertices and faces of equal versions belong together."""
        return self.message.mesh_version

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubts about the object that was detected, at any status."""
        return tuple(self.message.warnings)

    @cached_property
    def theta(self) -> NDArray[np.float64]:
        """Parameters of the deformation (dim,), SI units; empty before an object was found."""
        return _fixed(np.array(self.message.theta, float))

    @cached_property
    def theta_covariance(self) -> NDArray[np.float64]:
        """Covariance of theta (dim, dim); NaN if it is not known: LOST or INITIALIZING."""
        dimension = len(self.message.theta)
        full = np.full((dimension, dimension), np.nan)
        if self.message.covariance_valid:
            rows, columns = np.triu_indices(dimension)
            full[rows, columns] = full[columns, rows] = self.message.covariance
        return _fixed(full)

    @cached_property
    def vertices(self) -> NDArray[np.float32]:
        """Deformed vertices (n, 3) in the rig's frame [m]; (0, 3) before an object was found."""
        return np.frombuffer(self.mesh.vertices_f32, "<f4").reshape(-1, 3)

    @cached_property
    def undeformed(self) -> NDArray[np.float32]:
        """The same vertices (n, 3) before any deformation [m]."""
        return np.frombuffer(self.topology.rest_vertices_f32, "<f4").reshape(-1, 3)

    @cached_property
    def faces(self) -> NDArray[np.int32]:
        """Indices (m, 3) of the corners of the triangles."""
        return _fixed(np.frombuffer(self.topology.faces_u32, "<u4").reshape(-1, 3).astype(np.int32))

    @cached_property
    def colors(self) -> NDArray[np.uint8]:
        """Red, green, blue (n, 3) of the vertices in the first frame; (0, 3) without a colour sensor."""
        return np.frombuffer(self.topology.colors_u8, np.uint8).reshape(-1, 3)

    @cached_property
    def vertex_covariance(self) -> NDArray[np.float32]:
        """Covariance (n, 3, 3) of every vertex [m²]; NaN if it is not known: LOST or INITIALIZING."""
        if not self.mesh.covariance_f32:
            return _fixed(np.full((len(self.vertices), 3, 3), np.nan, np.float32))
        entries = np.frombuffer(self.mesh.covariance_f32, "<f4").reshape(-1, 6)
        return _fixed(entries[:, _TRIANGLE].reshape(-1, 3, 3))

    @cached_property
    def sigma(self) -> NDArray[np.float32]:
        """Root mean square distance (n,) of each vertex from its material point [m]; NaN if it is not known."""
        return _fixed(np.sqrt(np.trace(self.vertex_covariance, axis1=1, axis2=2)))

    @property
    def shares(self) -> Mapping[str, float]:
        """All shares of the estimate, 0 to 1, by the names of the message: `inlier`, `folded`, …."""
        return _shares(self.message)

    @property
    def sensor_shares(self) -> Mapping[str, Mapping[str, float]]:
        """The shares of each sensor, likewise; empty if the service sends none."""
        return MappingProxyType({one.sensor: _shares(one) for one in self.message.sensors})

    @property
    def sensors(self) -> Mapping[str, DeformationState.Sensor]:
        """Contribution of each sensor by its name: vertices visible, occluded, with a measurement, and so on."""
        return MappingProxyType({one.sensor: one for one in self.message.sensors})


def received(message: DeformationState, mesh: DeformedMesh, topology: MeshTopology, age_s: float) -> State:
    """The state that a tracker published."""
    status = _STATUS.get(message.status, Status.LOST)
    return State(message, mesh, topology, status, tuple(message.reasons), age_s)


def _shares(message: Message) -> Mapping[str, float]:
    names = [field.name for field in message.DESCRIPTOR.fields if field.name.endswith(_SHARE)]
    return MappingProxyType({name.removesuffix(_SHARE): getattr(message, name) for name in names})


def _fixed(array: NDArray) -> NDArray:
    array.setflags(write=False)
    return array
