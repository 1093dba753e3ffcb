"""Time stamp and sequence number of a message, parsed from its bytes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from absmsg.v1 import (
    common_pb2,
    deformation_state_pb2,
    deformed_mesh_pb2,
    frame_info_pb2,
    health_pb2,
    sensor_model_pb2,
    surface_truth_pb2,
)
from foxglove_schemas_protobuf import (
    CameraCalibration_pb2,
    FrameTransforms_pb2,
    PointCloud_pb2,
    RawImage_pb2,
    SceneUpdate_pb2,
)
from google.protobuf.message import DecodeError, Message
from google.protobuf.timestamp_pb2 import Timestamp

from abs_service.bus.contract import Sample


class MessageHeaderError(ValueError):
    """A message of an unknown type, or malformed."""


@dataclass(frozen=True, slots=True)
class MessageHeader:
    """Time stamp (wall clock) [ns], 0 if the message has none, sequence number, and the process that counts.

    And the same moment on a monotonic clock [ns], with the identity of that clock; 0 and "" if it does not say. And the
    number of its mesh, 0 if it has none.
    """

    stamp_ns: int
    seq: int
    publisher: str = ""
    t_host_ns: int = 0
    host_clock: str = ""
    mesh_version: int = 0


_WITH_HEADER = (
    deformation_state_pb2.DeformationState,
    deformation_state_pb2.CompactState,
    deformed_mesh_pb2.DeformedMesh,
    deformed_mesh_pb2.MeshTopology,
    health_pb2.Health,
    sensor_model_pb2.SensorModel,
    sensor_model_pb2.Config,
    surface_truth_pb2.SurfaceTruth,
)


def _ns(stamp: Timestamp) -> int:
    # Not `ToNanoseconds`, which raises for years outside its range.
    return stamp.seconds * 1_000_000_000 + stamp.nanos


def _of(header: common_pb2.Header, seq: int, mesh_version: int = 0) -> MessageHeader:
    return MessageHeader(_ns(header.stamp), seq, header.boot_id, header.t_host_ns, header.host_clock, mesh_version)


def _of_header(message: Any) -> MessageHeader:
    return _of(message.header, message.header.seq, getattr(message, "mesh_version", 0))


def _of_timestamp(message: Any) -> MessageHeader:
    return MessageHeader(_ns(message.timestamp), 0)


def _of_transforms(message: Any) -> MessageHeader:
    stamps = [_ns(transform.timestamp) for transform in message.transforms]
    return MessageHeader(max(stamps, default=0), 0)


def _of_scene(message: Any) -> MessageHeader:
    stamps = [_ns(part.timestamp) for part in (*message.entities, *message.deletions)]
    return MessageHeader(max(stamps, default=0), 0)


_PARSERS: Mapping[str, tuple[type[Message], Callable[[Any], MessageHeader]]] = {
    **{message.DESCRIPTOR.full_name: (message, _of_header) for message in _WITH_HEADER},
    CameraCalibration_pb2.CameraCalibration.DESCRIPTOR.full_name: (
        CameraCalibration_pb2.CameraCalibration,
        _of_timestamp,
    ),
    FrameTransforms_pb2.FrameTransforms.DESCRIPTOR.full_name: (FrameTransforms_pb2.FrameTransforms, _of_transforms),
    PointCloud_pb2.PointCloud.DESCRIPTOR.full_name: (PointCloud_pb2.PointCloud, _of_timestamp),
    SceneUpdate_pb2.SceneUpdate.DESCRIPTOR.full_name: (SceneUpdate_pb2.SceneUpdate, _of_scene),
}

IMAGE = RawImage_pb2.RawImage.DESCRIPTOR.full_name
INFO = frame_info_pb2.FrameInfo.DESCRIPTOR.full_name

CALIBRATION = CameraCalibration_pb2.CameraCalibration.DESCRIPTOR.full_name
TRANSFORMS = FrameTransforms_pb2.FrameTransforms.DESCRIPTOR.full_name
POINTS = PointCloud_pb2.PointCloud.DESCRIPTOR.full_name
SCENE = SceneUpdate_pb2.SceneUpdate.DESCRIPTOR.full_name
MODEL = sensor_model_pb2.SensorModel.DESCRIPTOR.full_name
CONFIG = sensor_model_pb2.Config.DESCRIPTOR.full_name
HEALTH = health_pb2.Health.DESCRIPTOR.full_name
TOPOLOGY = deformed_mesh_pb2.MeshTopology.DESCRIPTOR.full_name

#: Full names of all messages that a rig publishes.
MESSAGES = frozenset(_PARSERS) | {IMAGE, INFO}


def parse(sample: Sample) -> MessageHeader:
    """The header of a message; that of an image is in its attachment, so that the pixels need not be parsed.

    Raises:
        MessageHeaderError: the type is none of `MESSAGES`, or the bytes are not of that type.
    """
    try:
        if sample.message == IMAGE:
            info = frame_info_pb2.FrameInfo.FromString(sample.attachment)
            return _of(info.header, info.seq)
        message, header = _PARSERS[sample.message]
        return header(message.FromString(sample.payload))
    except KeyError:
        raise MessageHeaderError(f"{sample.topic}: {sample.message!r} is none of {sorted(MESSAGES)}") from None
    except DecodeError as error:
        raise MessageHeaderError(
            f"{sample.topic}: {len(sample.payload)} bytes are no {sample.message}: {error}"
        ) from None
