"""The edge of a process: decides which messages of the bus come in, and counts the others by cause."""

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from absmsg.v1 import (
    command_pb2,
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
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from drivers.contract.text import is_name, printable
from drivers.encoding import codec
from drivers.encoding.message_check import check_size, parse_valid
from drivers.encoding.message_content import MessageError

#: Topics of which messages are taken. A rig of ten sensors and four trackers has about 70.
MAX_TOPICS = 1000
#: Time without a message after which a topic makes room for a new one where there are that many [s].
QUIET_S = 600
#: Messages of one topic that are taken in a second; the fastest cameras deliver 300.
MAX_PER_S = 1000
#: Most parts of a topic: sensor, stream, image.
_MAX_PARTS = 3

_SECOND_NS = 1_000_000_000


class Edge:
    """Admits a message if topic and type are known and fit together, its content is valid, and it is not one too many.

    Thread-safe.

    Args:
        clock: CLOCK_MONOTONIC [ns], which tells the rate of messages.
    """

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._refused: Counter[str] = Counter()
        self._seconds: dict[str, tuple[int, int]] = {}  # by topic: second, and messages in it
        self._lock = threading.Lock()
        self.last_error = ""

    @property
    def refused(self) -> Mapping[str, int]:
        """Messages that were refused, by cause.

        Causes: `topic` that is none of ours, unknown `type`, too many `topics`, too high a `rate`, `size`, `malformed`
        bytes, `overwritten` before they were read, `text` that cannot be printed, `number` that is not finite, `range`
        of a number, `content` that does not fit together or not to the topic.
        """
        with self._lock:
            return dict(self._refused)

    def admits(self, sample: Sample) -> bool:
        """True if a message may come in; otherwise it is counted."""
        try:
            check_topic(sample.topic)
            self._check_rate(sample.topic)
            check_sample(sample)
        except MessageError as error:
            with self._lock:
                self._refused[error.cause] += 1
            self.last_error = printable(f"{sample.topic[:100]}: {error}"[:500])
            return False
        return True

    def _check_rate(self, topic: str) -> None:
        now_s = self._clock() // _SECOND_NS
        with self._lock:
            if topic not in self._seconds and len(self._seconds) >= MAX_TOPICS:
                quietest = next(iter(self._seconds))
                if now_s - self._seconds[quietest][0] < QUIET_S:
                    raise MessageError("topics", f"one more than {MAX_TOPICS} topics")
                del self._seconds[quietest]  # a flood of long ago must not keep out a tracker that is added
            second, number = self._seconds.pop(topic, (now_s, 0))  # the last one heard is at the end
            number = number + 1 if second == now_s else 1
            self._seconds[topic] = now_s, number
        if number > MAX_PER_S:
            raise MessageError("rate", f"more than {MAX_PER_S} messages a second")


def check_topic(topic: str) -> None:
    """Checks the parts of a topic.

    Raises:
        MessageError: too many parts, or one that is no name.
    """
    parts = topic.split("/")
    if len(parts) > _MAX_PARTS or not all(map(is_name, parts)):
        raise MessageError("topic", f"topics are one to {_MAX_PARTS} names with / in between")


def check_sample(sample: Sample) -> None:
    """Checks a message: its type, its content, and that it belongs to its topic.

    Raises:
        MessageError: names the field and the error.
    """
    if sample.overwritten:
        raise MessageError(
            "overwritten", "another message was in its memory before it was read: this process stood still"
        )
    if sample.message not in SCHEMAS:
        raise MessageError("type", f"{sample.message[:100]!r} is none of {sorted(SCHEMAS)}")
    schema = SCHEMAS[sample.message]
    if schema is RawImage_pb2.RawImage:
        _check_image(sample)
        return
    message = parse_valid(schema, sample.payload)
    if schema in _TOPICS and _TOPICS[schema](message) != sample.topic:
        raise MessageError("content", f"this {sample.message} belongs to {_TOPICS[schema](message)[:100]}")


def _check_image(sample: Sample) -> None:
    """Checks an image and its attachment; its pixels, which need not be ours to understand, are not read."""
    check_size(sample.message, sample.payload)
    codec.parse_image(sample.payload)
    if not keys.is_image(sample.topic):
        raise MessageError("content", "images are published on SENSOR/STREAM/image")
    if not sample.attachment:
        return
    info = parse_valid(frame_info_pb2.FrameInfo, sample.attachment)
    if keys.image(info.sensor, info.stream) != sample.topic:
        raise MessageError("content", f"this image is one of {info.sensor}/{info.stream}")


#: Types of the messages of a rig, by full name.
SCHEMAS: Mapping[str, type[Message]] = {
    schema.DESCRIPTOR.full_name: schema
    for schema in (
        RawImage_pb2.RawImage,
        health_pb2.Health,
        deformation_state_pb2.DeformationState,
        deformation_state_pb2.CompactState,
        deformed_mesh_pb2.DeformedMesh,
        deformed_mesh_pb2.MeshTopology,
        sensor_model_pb2.SensorModel,
        sensor_model_pb2.Config,
        surface_truth_pb2.SurfaceTruth,
        CameraCalibration_pb2.CameraCalibration,
        FrameTransforms_pb2.FrameTransforms,
        SceneUpdate_pb2.SceneUpdate,
        PointCloud_pb2.PointCloud,
        common_pb2.Header,
        command_pb2.Reinitialize,
        command_pb2.Record,
        command_pb2.Reload,
        command_pb2.SetControls,
        command_pb2.CommandAnswer,
        FileDescriptorSet,
    )
}

#: The topic that a message names, if it does.
_TOPICS: Mapping[type[Message], Callable[[Any], str]] = {
    health_pb2.Health: lambda message: keys.health(message.component),
    deformation_state_pb2.DeformationState: lambda message: keys.state(message.tracker),
    deformation_state_pb2.CompactState: lambda message: keys.theta(message.tracker),
    deformed_mesh_pb2.DeformedMesh: lambda message: keys.mesh(message.tracker),
    deformed_mesh_pb2.MeshTopology: lambda message: keys.topology(message.tracker),
    sensor_model_pb2.SensorModel: lambda message: keys.model(message.sensor),
    sensor_model_pb2.Config: lambda message: keys.CONFIG,
    CameraCalibration_pb2.CameraCalibration: lambda message: keys.calibration(message.frame_id),
    FrameTransforms_pb2.FrameTransforms: lambda message: keys.TRANSFORMS,
    common_pb2.Header: lambda message: keys.clock(message.host_clock),
    command_pb2.Reinitialize: lambda message: keys.reinitialize(message.tracker),
    command_pb2.Record: lambda message: keys.RECORD,
    command_pb2.Reload: lambda message: keys.RELOAD,
    command_pb2.SetControls: lambda message: keys.controls(message.device),
    FileDescriptorSet: lambda message: keys.SCHEMA,
}
