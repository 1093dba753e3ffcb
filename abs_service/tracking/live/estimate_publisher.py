"""Publishes the results of a tracker: estimates, meshes, their topologies, and scenes for viewers."""

from collections.abc import Callable

import numpy as np
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformed_mesh_pb2 import MeshTopology
from numpy.typing import NDArray

from abs_service.bus import keys
from abs_service.bus.clock_offsets import Offset
from abs_service.bus.contract import IMAGES, MESH, STATE, Bus
from abs_service.bus.stamps import HeaderFactory
from abs_service.tracker.estimates.estimate import Estimate
from abs_service.tracker.models.base import DeformationModel, HasVertexBasis
from abs_service.tracking.session import TrackingSession
from abs_service.wire import estimate_messages
from abs_service.wire.estimate_messages import Effort, Identity, State
from abs_service.wire.message_header import SCENE
from abs_service.wire.viewer_messages import ViewRate, scene_update

#: Change of the vertices' offsets that has them published for those who compute vertices, root mean square [m], and
#: rate at which they are published in any case, for those who come later [Hz].
OFFSETS_CHANGED_M, OFFSETS_HZ = 1e-4, 1.0

_NO_OFFSETS = np.zeros(0, np.float32)


class EstimatePublisher:
    """Publishes the estimates of one tracker, its meshes, and each new mesh's topology.

    Args:
        bus, headers: the bus, and the factory of headers.
        tracker: its name.
        model: type of its deformation model.
        calib_id: hash of its rig's calibration.
        view_hz: largest rate of the scenes [Hz]; 0 for none.
    """

    def __init__(self, bus: Bus, headers: HeaderFactory, tracker: str, model: str, calib_id: str, view_hz: float):
        self._headers = headers
        self._state = bus.publisher(keys.state(tracker), estimate_messages.STATE, STATE)
        self._mesh = bus.publisher(keys.mesh(tracker), estimate_messages.MESH, MESH)
        self._topology = bus.latched_publisher(keys.topology(tracker), estimate_messages.TOPOLOGY)
        self._compact = bus.publisher(keys.theta(tracker), estimate_messages.COMPACT, STATE)
        self._scene = bus.publisher(keys.scene(tracker), SCENE, IMAGES)
        self._view_rate, self._offset_rate = ViewRate(view_hz), ViewRate(OFFSETS_HZ)
        self._offset = _offset_of(None)
        self._sent_offset = _NO_OFFSETS
        self._topology_message = MeshTopology()
        self._identity = Identity(tracker, model, "", calib_id, 0)
        self._seq = 0

    def publish(
        self, estimate: Estimate, session: TrackingSession, effort: Effort, host_clock: str, offset: Offset
    ) -> None:
        """Publishes an estimate, after the topology of its mesh if that is new.

        Args:
            estimate, effort: to publish.
            session: its tracker.
            host_clock: which clock the frames' times are of.
            offset: of that clock; stamps need it.
        """
        if session.mesh is not None and session.mesh_version != self._identity.mesh_version:
            made = session.mesh, session.mesh_version, session.derived
            self._identity = estimate_messages.with_mesh(self._identity, *made)
            # Numbered by itself, or a recorder would take the estimates in between for topologies that it missed.
            header = self._header(session.made_ns, host_clock, offset, session.mesh_version)
            self._topology_message = estimate_messages.topology(header, session.mesh, self._identity, session.model)
            self._topology.put(self._topology_message.SerializeToString())
            self._offset = _offset_of(session.model)
        header = self._header(estimate.t_host_ns, host_clock, offset, self._seq)
        state = estimate_messages.state(header, estimate, self._identity, effort)
        mesh = estimate_messages.mesh(header, estimate, self._identity)
        self._state.put(state.SerializeToString())
        self._mesh.put(mesh.SerializeToString())
        self._publish_compact(state)
        if self._view_rate.due(estimate.t_host_ns):
            self._scene.put(scene_update(mesh, self._topology_message, state.status).SerializeToString())
        self._seq += 1

    def _publish_compact(self, state: State) -> None:
        """Publishes theta and status, with the offsets of the vertices if that is due."""
        now, sent = self._offset(), self._sent_offset
        is_new = len(now) != len(sent) or np.sum((now - sent) ** 2) > OFFSETS_CHANGED_M**2 * len(now)
        if is_due := self._offset_rate.due(state.header.t_host_ns) or is_new:
            self._sent_offset = now
        compact = estimate_messages.compact(state, now if is_due else _NO_OFFSETS)
        self._compact.put(compact.SerializeToString())

    def _header(self, t_host_ns: int, host_clock: str, offset: Offset, seq: int) -> Header:
        return self._headers.elsewhere(t_host_ns, host_clock, t_host_ns + offset.ns, seq, keys.RIG_FRAME)


def _offset_of(model: DeformationModel | None) -> Callable[[], NDArray[np.float32]]:
    """Offsets of a model's vertices as they are known when it is called; (0,) of a model without a basis."""
    return (lambda: model.offset) if isinstance(model, HasVertexBasis) else (lambda: _NO_OFFSETS)
