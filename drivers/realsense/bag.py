"""ROS 1 bags of librealsense: images, calibration and settings of their first device.

Topics are `/device_0/sensor_N/<Stream>_<index>/…`: `image/data`, `image/metadata` (key-value pairs with the image's
time), `info/camera_info` and `tf/0`, which maps points of the reference stream, depth, to the stream. (The direction is
undocumented; with the opposite one, depth and colour edges of a real recording are 20 px apart.)
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.camera import Camera
from drivers.contract.frame import Frame, Kind, Reference
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.encoding.parsing import CodecError, unpadded
from drivers.realsense.ros import Bag
from drivers.realsense.streams import Role, StreamError, camera, role_beside

_STREAM = r"/device_0/sensor_(?P<number>\d+)/(?P<type>[A-Za-z]+)_(?P<index>\d+)/"
_DEPTH_UNITS = r"/device_0/sensor_\d+/option/Depth Units/value"
_INFO_TOPICS = rf"{_STREAM}(?P<what>image/metadata|info/camera_info|tf/0)|{_DEPTH_UNITS}"
_IMAGES = f"{_STREAM}image/data"

#: ROS encodings and the corresponding frame encodings, by kind.
_ENCODINGS: Mapping[Kind, Mapping[str, str]] = {
    Kind.DEPTH: {"mono16": "16UC1", "16UC1": "16UC1"},
    Kind.IR: {"mono8": "mono8", "mono16": "mono16"},
    Kind.CONFIDENCE: {"mono8": "mono8"},
    Kind.COLOR: {"mono8": "mono8", "mono16": "mono16", "rgb8": "rgb8", "bgr8": "bgr8"},
}


@dataclass
class _BagInfo:
    """Metadata in the bag: cameras and poses by topic, and image metadata by topic and time."""

    infos: dict[str, Any] = field(default_factory=dict)
    transforms: dict[str, Any] = field(default_factory=dict)
    metadata: dict[tuple[str, int], dict[str, str]] = field(default_factory=dict)
    depth_unit_m: float = 0.001


class RealsenseBag:
    """The streams of the first device in a bag.

    Attributes:
        cameras: by head; the rig's frame is that of the reference stream, depth.
        total: number of images.

    Raises:
        ForeignRecordingError: unreadable file, `rosbags` is not installed, or malformed calibration.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._bag = Bag(path)
        counts = self._bag.counts()
        self._roles = {topic: role for topic in counts if (role := _role(topic, counts)) is not None}
        if not self._roles:
            raise ForeignRecordingError(
                f"{path}: there are no images of librealsense's recorder in this bag, its topics are {sorted(counts)}; "
                f"of a ROS driver's bag, `rosbags-convert --src {path.name} --dst {path.stem}` makes one that layout "
                "ros2 takes"
            )
        self._info = self._read_info()
        self.cameras: Mapping[str, Camera] = {}
        self.total = sum(counts[topic] for topic in self._roles)
        try:
            cameras = {topic: self._camera(topic) for topic in self._roles}
        except (StreamError, ValueError) as error:
            raise ForeignRecordingError(f"{path}: {error}") from error
        self.cameras = {self._roles[topic].sensor: camera for topic, camera in cameras.items()}

    def frames(self) -> Iterator[Frame]:
        """All images. Host times follow the device's clock, with the host's time at the first image as origin."""
        offsets_ns: dict[str, int] = {}
        for message in self._bag.messages(_IMAGES):
            if message.topic in self._roles:
                metadata = self._info.metadata.get((message.topic, message.time_ns), {})
                domain = metadata.get("timestamp_domain", "unknown").lower()
                stamp = message.content.header.stamp
                ticks = stamp.sec * 1_000_000_000 + stamp.nanosec
                host_ns = _number(metadata, "system_time", ticks * 1e-6) * 1e6
                t_ns = max(ticks + offsets_ns.setdefault(domain, round(host_ns) - ticks), 0)
                try:
                    yield self._frame(self._roles[message.topic], message.content, metadata, t_ns, ticks, domain)
                except (StreamError, CodecError) as error:
                    raise ForeignRecordingError(f"{self._path}: {message.topic}: {error}") from error

    def _frame(self, role: Role, image: Any, metadata: Mapping[str, str], t_ns: int, ticks: int, domain: str) -> Frame:
        is_depth = role.kind == Kind.DEPTH
        encoding, data = pixels(role.kind, image)
        return Frame(
            sensor=role.sensor,
            stream=role.stream,
            kind=role.kind,
            data=data,
            encoding=encoding,
            t_host_ns=t_ns,
            t_arrival_ns=t_ns,
            seq=image.header.seq,
            scale=self._info.depth_unit_m if is_depth else 1.0,
            geometry=role.geometry,
            invalid=0.0 if is_depth else None,
            t_device_ticks=ticks,
            tick_hz=1e9,
            clock_domain=domain,
            t_reference=Reference.END,
            exposure_s=_number(metadata, "Actual Exposure", math.nan) * role.exposure_unit_s,
            gain=_number(metadata, "Gain Level", math.nan),
            calib_id=self.cameras[role.sensor].calib_id,
        )

    def _read_info(self) -> _BagInfo:
        info = _BagInfo()
        for message in self._bag.messages(_INFO_TOPICS):
            match = re.fullmatch(_INFO_TOPICS, message.topic)
            what = match["what"] if match else None
            images = f"{message.topic.removesuffix(what or '')}image/data"
            if what is None:
                info.depth_unit_m = float(message.content.data)
            elif what == "image/metadata":
                info.metadata.setdefault((images, message.time_ns), {})[message.content.key] = message.content.value
            else:
                (info.infos if what == "info/camera_info" else info.transforms)[images] = message.content
        if not 0 < info.depth_unit_m < math.inf:
            raise ForeignRecordingError(f"{self._path}: a depth unit of {info.depth_unit_m} m is none")
        return info

    def _camera(self, topic: str) -> Camera:
        if topic not in self._info.infos or topic not in self._info.transforms:
            raise StreamError(f"{topic} has no camera_info or no transform beside it")
        info, transform = self._info.infos[topic], self._info.transforms[topic]
        q, t = transform.rotation, transform.translation
        T_sensor_reference = pose.from_quaternion([q.x, q.y, q.z, q.w], [t.x, t.y, t.z])
        matrix = (info.K[0], info.K[4], info.K[2], info.K[5])
        model = info.distortion_model.lower()
        return camera(topic, (info.width, info.height), matrix, model, info.D, pose.inverse(T_sensor_reference))


def pixels(kind: Kind, image: Any) -> tuple[str, NDArray[np.generic]]:
    """Encoding and array of a sensor_msgs/Image.

    Raises:
        StreamError: an encoding that is not supported for the kind.
        CodecError: too few bytes.
    """
    allowed = _ENCODINGS[kind]
    if image.encoding not in allowed or image.is_bigendian:
        raise StreamError(f"{kind} must be encoded as one of {sorted(allowed)}, little-endian, not {image.encoding!r}")
    encoding = allowed[image.encoding]
    return encoding, unpadded(image.data, encoding, image.width, image.height, image.step)


def _role(topic: str, topics: Iterable[str]) -> Role | None:
    """Stream of a topic; None for unused topics, such as those of a second device."""
    match = re.fullmatch(_IMAGES, topic)
    if match is None:
        return None
    others = [other for one in topics if (other := re.fullmatch(_IMAGES, one)) and other["number"] == match["number"]]
    return role_beside((match["type"].lower(), int(match["index"])), {other["type"].lower() for other in others})


def _number(metadata: Mapping[str, str], key: str, default: float) -> float:
    try:
        value = float(metadata.get(key, default))
    except ValueError:
        return default
    return value if math.isfinite(value) else default
