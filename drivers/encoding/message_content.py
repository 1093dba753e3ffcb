"""Checks that the parts of a message from another program fit together: sizes, names, numbers of points."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from absmsg.v1.command_pb2 import Reinitialize
from absmsg.v1.deformation_state_pb2 import CompactState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.sensor_model_pb2 import SensorModel
from absmsg.v1.surface_truth_pb2 import SurfaceTruth

from drivers.contract.text import is_name
from drivers.encoding.parsing import CodecError

#: Most points of a truth, whose surfaces are searched for the vertices of every estimate, or of a mesh for viewers.
MAX_POINTS = 1 << 18
#: Fewest and most corners of a polygon that a user draws around an object.
MIN_CORNERS, MAX_CORNERS = 3, 256


class MessageError(CodecError):
    """A message is refused.

    Attributes:
        cause: why, in one word, to count it by: size, malformed, text, number, range or content.
    """

    def __init__(self, cause: str, reason: str) -> None:
        super().__init__(reason)
        self.cause = cause


def _require(holds: bool, reason: str) -> None:
    if not holds:
        raise MessageError("content", reason)


def _check_info(info: FrameInfo) -> None:
    names = is_name(info.sensor) and is_name(info.stream)
    _require(names, f"FrameInfo of {info.sensor!r}/{info.stream!r}: these are no names of a sensor and a stream")
    _require(info.scale > 0, f"{info.sensor}/{info.stream}: scale must be positive and finite, not {info.scale}")
    _require(info.tick_hz >= 0, f"{info.sensor}/{info.stream}: tick_hz must be 0 or more, not {info.tick_hz}")


def _check_model(model: SensorModel) -> None:
    # Nothing else makes sure that there is one: zeros are not sent.
    is_camera = model.width > 0 and model.height > 0 and model.fx > 0 and model.fy > 0
    _require(is_name(model.sensor), f"{model.sensor!r} is no name of a sensor")
    _require(is_camera, f"{model.sensor}: {model.width} × {model.height} px, f = {model.fx}, {model.fy} is no camera")
    _require(len(model.T_rs) == 16, f"{model.sensor}: T_rs has {len(model.T_rs)} numbers, 16 are a pose")


def _check_reinitialize(command: Reinitialize) -> None:
    corners = len(command.polygon)
    _require(not (corners and command.HasField("seed")), "a seed and a polygon: one of them says where the object is")
    allowed = corners == 0 or MIN_CORNERS <= corners <= MAX_CORNERS
    _require(allowed, f"a polygon of {corners} corners: {MIN_CORNERS} to {MAX_CORNERS} are allowed")


def _check_truth(truth: SurfaceTruth) -> None:
    points = truth.rows * truth.columns
    size = f"SurfaceTruth of {truth.rows} × {truth.columns} points"
    _require(0 < points <= MAX_POINTS, f"{size}: 1 to {MAX_POINTS} are allowed")
    _require(_points("points_f32", truth.points_f32) == points, f"{size} has {len(truth.points_f32)} bytes")


def _check_mesh(mesh: DeformedMesh) -> None:
    vertices = _points("vertices_f32", mesh.vertices_f32)
    covariances = len(mesh.covariance_f32)
    _require(covariances in (0, 24 * vertices), f"{covariances} bytes are not {vertices} covariances")
    classes = len(mesh.rim_classes_u8)
    _require(classes in (0, vertices), f"{classes} rim classes are not those of {vertices} vertices")


def _check_topology(topology: MeshTopology) -> None:
    vertices = _points("rest_vertices_f32", topology.rest_vertices_f32)
    _require(len(topology.faces_u32) % 12 == 0, f"faces_u32: {len(topology.faces_u32)} bytes are no triangles")
    faces = np.frombuffer(topology.faces_u32, "<u4")
    _require(not faces.size or int(faces.max()) < vertices, f"a face of {vertices} vertices has others")
    colors = len(topology.colors_u8)
    _require(colors in (0, 3 * vertices), f"{colors} bytes are not {vertices} colours")
    each = topology.basis.support * vertices
    sizes = [len(value) for field, value in topology.basis.ListFields() if field.name != "support"]
    fits = sizes == [2 * each, 4 * each, 4 * each, 4 * each, 4 * vertices]
    _require(fits or not topology.HasField("basis"), f"basis: its sizes are not those of {vertices} vertices")


def _check_compact(state: CompactState) -> None:
    _floats("theta_f32", state.theta_f32)
    _floats("offset_f32", state.offset_f32)


def _points(name: str, xyz_f32: bytes) -> int:
    """Number of points in bytes."""
    _require(len(xyz_f32) % 12 == 0, f"{name}: {len(xyz_f32)} bytes are no points")
    return _floats(name, xyz_f32) // 3


def _floats(name: str, f32: bytes) -> int:
    """Number of numbers in bytes."""
    _require(len(f32) % 4 == 0, f"{name}: {len(f32)} bytes are no numbers")
    if not np.isfinite(np.frombuffer(f32, "<f4")).all():
        raise MessageError("number", f"{name} must be finite")
    return len(f32) // 4


#: What has to fit together in a message of a type, by its full name.
CONTENT: Mapping[str, Callable[[Any], None]] = {
    FrameInfo.DESCRIPTOR.full_name: _check_info,
    Reinitialize.DESCRIPTOR.full_name: _check_reinitialize,
    SensorModel.DESCRIPTOR.full_name: _check_model,
    SurfaceTruth.DESCRIPTOR.full_name: _check_truth,
    CompactState.DESCRIPTOR.full_name: _check_compact,
    DeformedMesh.DESCRIPTOR.full_name: _check_mesh,
    MeshTopology.DESCRIPTOR.full_name: _check_topology,
}
