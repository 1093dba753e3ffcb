"""A tracker that is nothing but its messages."""

import time

import numpy as np

from abs_service.bus import keys
from abs_service.bus.contract import MESH, STATE
from abs_service.wire import estimate_messages
from drivers.contract.host_clock import host_clock
from tests.client.messages import TRIANGLE, mesh, state, topology
from tests.waiting import repeating

PERIOD_S = 0.01


class Tracker:
    """Publishes estimates as a tracker does: a mesh's topology once, then state and vertices."""

    def __init__(self, bus, boot):
        self.boot, self.seq, self.version, self.size = boot, 0, 0, 3
        self._topology = bus.latched_publisher(keys.topology("sheet"), estimate_messages.TOPOLOGY)
        self._state = bus.publisher(keys.state("sheet"), estimate_messages.STATE, STATE)
        self._mesh = bus.publisher(keys.mesh("sheet"), estimate_messages.MESH, MESH)

    @property
    def vertices(self):
        return np.resize(TRIANGLE, (self.size, 3))

    def remesh(self):
        self.version, self.size = self.version + 1, self.size + 1
        self._topology.put(topology(self.version, self.boot, self.vertices).SerializeToString())

    def put_malformed(self):
        self._state.put(b"\xff\xff\xff")

    def estimate(self, age_s=0.0):
        stamps = {"t_host_ns": time.monotonic_ns() - round(age_s * 1e9), "host_clock": host_clock()}
        self._state.put(state(self.seq, self.version, self.boot, age_ms=age_s * 1e3, **stamps).SerializeToString())
        self._mesh.put(mesh(self.seq, self.version, self.boot, self.vertices).SerializeToString())
        self.seq += 1


def estimating(tracker, **settings):
    """Goes on estimating."""
    return repeating(lambda: tracker.estimate(**settings), PERIOD_S)
