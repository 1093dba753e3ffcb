"""Estimates of no tracker, of the size of one with 48 parameters and 400 vertices, 30 times a second."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from abs_service.bus import keys
from abs_service.bus.contract import MESH, STATE
from abs_service.bus.zenoh_bus import ZenohBus
from drivers.contract.host_clock import host_clock

RATE_HZ = 30.0
PARAMETERS, SIDE = 48, 20


@contextmanager
def publishing(bus: ZenohBus) -> Iterator[None]:
    """Publishes as tracker `sheet` of the bus's rig until the block ends."""
    end = threading.Event()
    token = bus.declare_liveliness("track/sheet")
    thread = threading.Thread(target=_publish, args=(bus, end))
    thread.start()
    try:
        yield
    finally:
        end.set()
        thread.join()
        token.close()


def _publish(bus: ZenohBus, end: threading.Event) -> None:
    topology, vertices = _sheet()
    latched = bus.latched_publisher(keys.topology("sheet"), topology.DESCRIPTOR.full_name)
    states = bus.publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    meshes = bus.publisher(keys.mesh("sheet"), DeformedMesh.DESCRIPTOR.full_name, MESH)
    latched.put(topology.SerializeToString())
    theta, covariance = [0.1] * PARAMETERS, [1e-6] * (PARAMETERS * (PARAMETERS + 1) // 2)
    seq, due_s = 0, time.monotonic()
    while not end.wait(max(due_s - time.monotonic(), 0.0)):
        seq, due_s = seq + 1, due_s + 1 / RATE_HZ
        header = Header(rig="demo", boot_id="evaluation", seq=seq, host_clock=host_clock())
        header.stamp.FromNanoseconds(time.time_ns())
        header.t_host_ns = time.monotonic_ns()
        shared = {"header": header, "tracker": "sheet", "mesh_version": 1}
        state = DeformationState(
            status=DeformationState.STATUS_TRACKING, theta=theta, covariance=covariance, covariance_valid=True, **shared
        )
        states.put(state.SerializeToString())
        meshes.put(DeformedMesh(vertices_f32=vertices, **shared).SerializeToString())


def _sheet() -> tuple[MeshTopology, bytes]:
    y, x = np.mgrid[0:SIDE, 0:SIDE] / SIDE
    vertices = np.stack([x, y, np.ones_like(x)], axis=-1).astype("<f4").tobytes()
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, SIDE], corner[:, None] + [1, SIDE + 1, SIDE]])
    header = Header(rig="demo", boot_id="evaluation")
    return (
        MeshTopology(
            header=header,
            tracker="sheet",
            mesh_version=1,
            rest_vertices_f32=vertices,
            faces_u32=faces.astype("<u4").tobytes(),
        ),
        vertices,
    )
