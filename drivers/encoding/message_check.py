"""Validation of messages from other programs, by schema and range: the only place that defines valid messages.

A publisher can send any bytes. Messages that pass can be displayed, processed and recorded without another check.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from absmsg.v1.command_pb2 import Reinitialize
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.sensor_model_pb2 import SensorModel
from absmsg.v1.surface_truth_pb2 import SurfaceTruth
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from drivers.contract.text import LONGEST, is_name, is_printable
from drivers.encoding.parsing import CodecError, parse_message

#: Largest message of any type [bytes]; of an image: 8192 × 8192 pixels of four bytes.
LARGEST, LARGEST_IMAGE = 1 << 24, 1 << 28
#: Longest text of a configuration [characters].
LONGEST_FILE = 1 << 20
#: Most entries of a map, and most texts or messages in a list.
MAX_ENTRIES = 2000
#: Most points of a truth, whose surfaces are searched for the vertices of every estimate, or of a mesh for viewers.
MAX_POINTS = 1 << 18
#: Fewest and most corners of a polygon that a user draws around an object.
MIN_CORNERS, MAX_CORNERS = 3, 256
#: Largest image [pixels along a side].
LARGEST_SIDE = 1 << 14
#: A larger gap in sequence numbers is no loss: the numbers are not those of one publisher.
LARGEST_GAP = 1_000_000

_TIME_NS = 1 << 62  # differences of two times fit into 64 bits

#: Ranges of integers, both ends allowed; all others have that of their type.
_RANGES: Mapping[str, tuple[int, int]] = {
    "google.protobuf.Timestamp.seconds": (0, (1 << 63) // 10**9 - 1),
    "google.protobuf.Timestamp.nanos": (0, 999_999_999),
    "absmsg.v1.Header.t_host_ns": (-_TIME_NS, _TIME_NS),
    "absmsg.v1.Header.seq": (0, 1 << 62),
    "absmsg.v1.FrameInfo.seq": (0, 1 << 62),
    "absmsg.v1.FrameInfo.t_sigma_ns": (0, _TIME_NS),
    "absmsg.v1.FrameInfo.t_arrival_ns": (-_TIME_NS, _TIME_NS),
    "absmsg.v1.Reinitialize.Pixel.column": (0, LARGEST_SIDE - 1),
    "absmsg.v1.Reinitialize.Pixel.row": (0, LARGEST_SIDE - 1),
    "absmsg.v1.DeformationState.Sensor.t_host_ns": (-_TIME_NS, _TIME_NS),
    "absmsg.v1.DeformationState.Sensor.seq": (0, 1 << 62),
    "absmsg.v1.SensorModel.width": (1, LARGEST_SIDE),
    "absmsg.v1.SensorModel.height": (1, LARGEST_SIDE),
    "foxglove.RawImage.width": (0, LARGEST_SIDE),
    "foxglove.RawImage.height": (0, LARGEST_SIDE),
}

#: Lists of which only the length is checked: points and colours that only viewers read.
_VIEWED = frozenset(f"foxglove.TriangleListPrimitive.{name}" for name in ("points", "colors"))

#: Numbers that are used without a look: neither NaN nor infinite. Of others, NaN and infinity mean unknown.
_FINITE = frozenset(
    {
        "absmsg.v1.DeformationState.theta",
        "absmsg.v1.DeformationState.solve_ms",
        "absmsg.v1.Health.GaugesEntry.value",
        "absmsg.v1.FrameInfo.scale",
        "absmsg.v1.FrameInfo.tick_hz",
        *(f"absmsg.v1.SensorModel.{name}" for name in ("fx", "fy", "cx", "cy", "lens", "T_rs")),
    }
)


class MessageError(CodecError):
    """A message is refused.

    Attributes:
        cause: why, in one word, to count it by: size, malformed, text, number, range or content.
    """

    def __init__(self, cause: str, reason: str) -> None:
        super().__init__(reason)
        self.cause = cause


_AnyMessage = TypeVar("_AnyMessage", bound=Message)


def parse_valid(schema: type[_AnyMessage], payload: bytes) -> _AnyMessage:
    """The message of a schema in serialized bytes, if it is a valid one.

    Raises:
        MessageError: too many or malformed bytes, or as `check`.
    """
    check_size(schema.DESCRIPTOR.full_name, payload)
    try:
        message = parse_message(schema, payload)
    except CodecError as error:
        raise MessageError("malformed", str(error)) from error
    check(message)
    return message


def check_size(message: str, payload: bytes) -> None:
    """Checks the size of a message of this full name.

    Raises:
        MessageError: it is too large.
    """
    largest = LARGEST_IMAGE if message.endswith("Image") else LARGEST
    if len(payload) > largest:
        raise MessageError("size", f"{message} of {len(payload)} bytes, {largest} are allowed")


def check(message: Message) -> None:
    """Checks texts, numbers and sizes of a parsed message.

    Raises:
        MessageError: one of them is not allowed; names it.
    """
    _check_fields(message)
    _CONTENT.get(message.DESCRIPTOR.full_name, lambda _: None)(message)


def _check_fields(message: Message) -> None:
    for field, value in message.ListFields():
        name = field.full_name
        if field.message_type is not None and field.message_type.GetOptions().map_entry:
            _check_count(name, len(value))
            entry = field.message_type.fields_by_name
            _check_values(entry["key"], value)
            _check_values(entry["value"], value.values())
        elif name in _VIEWED:
            _check_count(name, len(value), MAX_POINTS)
        elif field.is_repeated:
            if field.cpp_type in (FieldDescriptor.CPPTYPE_MESSAGE, FieldDescriptor.CPPTYPE_STRING):
                _check_count(name, len(value))
            _check_values(field, value)
        else:
            _check_values(field, (value,))


def _check_values(field: FieldDescriptor, values: Iterable[Any]) -> None:
    """Checks all values of a field, of a list or of the keys or values of a map."""
    name, kind = field.full_name, field.cpp_type
    if kind == FieldDescriptor.CPPTYPE_MESSAGE:
        for value in values:
            _check_fields(value)
    elif kind == FieldDescriptor.CPPTYPE_STRING and field.type != FieldDescriptor.TYPE_BYTES:
        longest = LONGEST_FILE if name == "absmsg.v1.Config.toml" else LONGEST
        odd = next((value for value in values if not is_printable(value, longest)), None)
        if odd is not None:
            raise MessageError("text", f"{name} = {odd[:40]!r} is too long or cannot be printed")
    elif field.enum_type is not None:
        known = field.enum_type.values_by_number
        _require_all(name, values, known.__contains__, "range", f"must be one of {sorted(known)}")
    elif name in _FINITE:
        _require_all(name, values, math.isfinite, "number", "must be finite")
    elif name in _RANGES:
        low, high = _RANGES[name]
        _require_all(name, values, lambda value: low <= value <= high, "range", f"must be in {low} … {high}")


def _require_all(name: str, values: Iterable[Any], holds: Callable[[Any], bool], cause: str, rule: str) -> None:
    odd = next((value for value in values if not holds(value)), None)
    if odd is not None:
        raise MessageError(cause, f"{name} = {odd} {rule}")


def _check_count(name: str, number: int, most: int = MAX_ENTRIES) -> None:
    if number > most:
        raise MessageError("size", f"{name} has {number} entries, {most} are allowed")


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
    _require(len(truth.points_f32) == 12 * points, f"{size} has {len(truth.points_f32)} bytes")


def _check_mesh(mesh: DeformedMesh) -> None:
    vertices = _points("vertices_f32", mesh.vertices_f32)
    covariances = len(mesh.covariance_f32)
    _require(covariances in (0, 24 * vertices), f"{covariances} bytes are not {vertices} covariances")


def _check_topology(topology: MeshTopology) -> None:
    vertices = _points("rest_vertices_f32", topology.rest_vertices_f32)
    _require(len(topology.faces_u32) % 12 == 0, f"faces_u32: {len(topology.faces_u32)} bytes are no triangles")
    faces = np.frombuffer(topology.faces_u32, "<u4")
    _require(not faces.size or int(faces.max()) < vertices, f"a face of {vertices} vertices has others")
    _require(
        len(topology.colors_u8) in (0, 3 * vertices), f"{len(topology.colors_u8)} bytes are not {vertices} colours"
    )


def _points(name: str, xyz_f32: bytes) -> int:
    """Number of points in bytes."""
    _require(len(xyz_f32) % 12 == 0, f"{name}: {len(xyz_f32)} bytes are no points")
    if not np.isfinite(np.frombuffer(xyz_f32, "<f4")).all():
        raise MessageError("number", f"{name} must be finite")
    return len(xyz_f32) // 12


#: What has to fit together in a message of a type, by its full name.
_CONTENT: Mapping[str, Callable[[Any], None]] = {
    FrameInfo.DESCRIPTOR.full_name: _check_info,
    Reinitialize.DESCRIPTOR.full_name: _check_reinitialize,
    SensorModel.DESCRIPTOR.full_name: _check_model,
    SurfaceTruth.DESCRIPTOR.full_name: _check_truth,
    DeformedMesh.DESCRIPTOR.full_name: _check_mesh,
    MeshTopology.DESCRIPTOR.full_name: _check_topology,
}
