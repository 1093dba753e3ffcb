"""Messages of somebody who wants to do harm: random bytes, and valid messages with some extreme fields."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from absmsg.v1.command_pb2 import Control, Record, Reinitialize, Reload, SetControls
from absmsg.v1.common_pb2 import Header
from absmsg.v1.deformation_state_pb2 import CompactState, DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import Config, SensorModel
from absmsg.v1.surface_truth_pb2 import SurfaceTruth
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message
from hypothesis import strategies as st

from abs_service.bus import keys
from abs_service.bus.contract import Sample

INTEGERS = (0, 1, -1, 2**31 - 1, -(2**31), 2**32 - 1, 2**63 - 1, -(2**63), 2**64 - 1)
NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-320, 1e308, -1e308, math.nan, math.inf, -math.inf)
TEXTS = ("", "tof", "sheet", "\x1b[2J", "[/red]", "../../x", "\x00", "a" * 70_000, "\u202e", "%s{0}", "\n" * 50)
#: Topics of every kind, of which the rig of the tests has some.
TOPICS = (
    "tof/depth/image",
    "tof/model",
    "tof/calibration",
    "tf",
    "config",
    "schema",
    "sim/truth",
    "sheet/state",
    "sheet/mesh",
    "sheet/topology",
    "sheet/reinitialize",
    "reload",
    "health/capture",
    "health/record",
    "health/run",
    "health/track/sheet",
    "record",
    "clock/there",
    "live/capture",
    "other/thing",
    "a/b/c/d/e",
    "-/\x1b[2J/image",
)
INFO = FrameInfo(sensor="tof", stream="depth", kind="depth", scale=0.001, geometry=FrameInfo.GEOMETRY_RADIAL)
MODEL = SensorModel(
    sensor="tof", width=32, height=24, fx=30, fy=30, cx=16, cy=12, T_rs=[float(i % 5 == 0) for i in range(16)]
)
#: A valid message on each topic that has some.
VALID: Mapping[str, Message] = {
    "tof/depth/image": RawImage(frame_id="tof", width=2, height=1, encoding="mono8", step=2, data=b"12"),
    "tof/model": MODEL,
    "tof/calibration": CameraCalibration(frame_id="tof", width=32, height=24),
    "tf": FrameTransforms(),
    "config": Config(toml="version = 1\n"),
    "sim/truth": SurfaceTruth(rows=1, columns=2, points_f32=bytes(24)),
    "sheet/state": DeformationState(tracker="sheet", theta=[0.0], status=DeformationState.STATUS_TRACKING),
    "sheet/theta": CompactState(tracker="sheet", theta_f32=bytes(36), offset_f32=bytes(8)),
    "sheet/mesh": DeformedMesh(tracker="sheet", vertices_f32=bytes(24), covariance_f32=bytes(48)),
    "sheet/topology": MeshTopology(tracker="sheet", rest_vertices_f32=bytes(24), faces_u32=bytes(12)),
    "sheet/reinitialize": Reinitialize(tracker="sheet", seed=Reinitialize.Pixel(column=111, row=133)),
    "record": Record(recording=True),
    "reload": Reload(),
    "sim/controls": SetControls(device="sim", controls=[Control(name="exposure_s", number=0.01)]),
    **{f"health/{name}": Health(component=name) for name in ("capture", "record", "run", "track/sheet")},
    "clock/there": Header(host_clock="there", t_host_ns=1),
}
_LIMITS = {
    FieldDescriptor.CPPTYPE_INT32: (-(2**31), 2**31 - 1),
    FieldDescriptor.CPPTYPE_UINT32: (0, 2**32 - 1),
    FieldDescriptor.CPPTYPE_INT64: (-(2**63), 2**63 - 1),
    FieldDescriptor.CPPTYPE_UINT64: (0, 2**64 - 1),
}


def value(field: FieldDescriptor) -> st.SearchStrategy[Any]:
    """Extreme values of a field that holds no message."""
    kind = field.cpp_type
    if kind == FieldDescriptor.CPPTYPE_STRING:
        is_bytes = field.type == FieldDescriptor.TYPE_BYTES
        return st.binary(max_size=60) if is_bytes else st.sampled_from(TEXTS)
    if kind in (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT):
        return st.sampled_from(NUMBERS)
    if kind == FieldDescriptor.CPPTYPE_BOOL:
        return st.booleans()
    if kind == FieldDescriptor.CPPTYPE_ENUM:
        known = field.enum_type.values_by_number if field.enum_type else ()
        return st.sampled_from([*known, 9, -1])
    low, high = _LIMITS[kind]
    return st.sampled_from([number for number in INTEGERS if low <= number <= high])


def spoil(draw: Callable[..., Any], message: Any) -> None:
    """Gives one field of a message, or of a message in it, an extreme value."""
    field = draw(st.sampled_from(tuple(message.DESCRIPTOR.fields)))
    kind, held = field.message_type, getattr(message, field.name)
    if kind is not None and kind.GetOptions().map_entry:
        key = draw(
            value(kind.fields_by_name["key"]) | st.sampled_from(["file", "file_bytes", "published.[/x]/y/image"])
        )
        inner = kind.fields_by_name["value"]
        if inner.message_type is None:
            held[key] = draw(value(inner))
        else:
            spoil(draw, held[key])
    elif kind is not None:
        spoil(draw, (held[0] if len(held) else held.add()) if field.is_repeated else held)
    elif field.is_repeated:
        held.extend(draw(st.lists(value(field), max_size=3)))
    else:
        setattr(message, field.name, draw(value(field)))


@st.composite
def messages(draw: st.DrawFn, valid: Message) -> bytes:
    """A valid message, in which up to three fields become extreme."""
    message = type(valid).FromString(valid.SerializeToString())
    for _ in range(draw(st.integers(0, 3))):
        spoil(draw, message)
    return message.SerializeToString()


@st.composite
def samples(draw: st.DrawFn, topics: Sequence[str] = TOPICS) -> Sample:
    """A message on any of some topics: mostly of the topic's type, else of another one, or bytes that are none."""
    topic = draw(st.sampled_from(topics))
    valid = VALID.get(topic, INFO)
    if not draw(st.integers(0, 3)):
        valid = draw(st.sampled_from([*VALID.values(), INFO]))
    name = draw(st.sampled_from([valid.DESCRIPTOR.full_name] * 6 + ["", "foxglove.Grid"]))
    payload = draw(messages(valid)) if draw(st.integers(0, 7)) else draw(st.binary(max_size=60))
    attachment = draw(messages(INFO) | st.just(b"") | st.binary(max_size=60)) if keys.is_image(topic) else b""
    return Sample(topic, name, payload, attachment)
