"""A recording with images and with estimates that nobody computed: every status, two meshes."""

from pathlib import Path

import numpy as np
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from drivers.encoding.encoded_image import ImageEncoder, unchanged
from drivers.encoding.mcap_file import McapFile
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import WALL_NS, write_take

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&sensors=tof,color").build()
NAMES = {"tof": "tof", "color": "color"}
STATUSES = ("INITIALIZING", "TRACKING", "TRACKING", "DEGRADED", "LOST", "TRACKING")
FACES = {1: np.array([[0, 1, 2], [2, 1, 3]], "<u4"), 2: np.array([[0, 1, 2]], "<u4")}
SIZES = {0: 0, 1: 4, 2: 3}
RGB = np.arange(12, dtype="u1").reshape(4, 3) * 20
TOML = "version = 1\n"


def version(k: int) -> int:
    """Version of the mesh of estimate k; 0 for none."""
    return (0, 1, 1, 1, 1, 2)[k]


def vertices(k: int) -> np.ndarray:
    """Vertices of estimate k [m], as they are sent."""
    return np.random.default_rng(k).normal(size=(SIZES[version(k)], 3)).astype("<f4")


def theta(k: int) -> np.ndarray:
    """Θ of estimate k."""
    return np.arange(2.0) + k if version(k) else np.zeros(0)


def write_estimated(path: Path, encode_image: ImageEncoder = unchanged, finish: bool = True) -> Path:
    """Writes the recording: an estimate for each exposure 0 to 5."""
    return write_take(path, SIMULATION, range(6), NAMES, TOML, finish, encode_image, _write_estimate)


def _write_estimate(file: McapFile, k: int) -> None:
    t_ns = SIMULATION.time_ns(k)
    header = Header(t_host_ns=t_ns, seq=k, rig="demo", frame_id="rig", boot_id="b")
    header.stamp.FromNanoseconds(WALL_NS + t_ns)
    if version(k) and (k == 0 or version(k) != version(k - 1)):
        topology = MeshTopology(header=header, tracker="sheet", mesh_version=version(k))
        topology.faces_u32 = FACES[version(k)].tobytes()
        topology.rest_vertices_f32 = vertices(k).tobytes()
        topology.colors_u8 = RGB[: SIZES[version(k)]].tobytes()
        _write(file, "/sheet/topology", topology, t_ns)
    state = DeformationState(header=header, tracker="sheet", mesh_version=version(k), status=f"STATUS_{STATUSES[k]}")
    state.theta.extend(theta(k).tolist())
    state.reasons.extend(["no frame from color"] if STATUSES[k] == "DEGRADED" else [])
    state.covariance_valid = STATUSES[k] in ("TRACKING", "DEGRADED")
    state.covariance.extend([4.0, 0.0, 9.0] if version(k) else [])
    state.deviation_m = 0.001 * k
    _write(file, "/sheet/state", state, t_ns)
    mesh = DeformedMesh(header=header, tracker="sheet", mesh_version=version(k), vertices_f32=vertices(k).tobytes())
    if state.covariance_valid:
        mesh.covariance_f32 = np.tile([1, 0, 0, 4, 0, 4], (SIZES[version(k)], 1)).astype("<f4").tobytes()
    _write(file, "/sheet/mesh", mesh, t_ns)


def _write(file: McapFile, topic: str, content: DeformationState | DeformedMesh | MeshTopology, t_ns: int) -> None:
    file.write(topic, content.DESCRIPTOR.full_name, content.SerializeToString(), WALL_NS + t_ns, content.header.seq)
