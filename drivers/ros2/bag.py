"""Images of a ROS 2 bag with the cameras that it describes.

An image topic `/camera/depth/image_rect_raw`, or `…/image_raw/compressed`, has its calibration in
`/camera/depth/camera_info` and is the head `depth`. A name with `rect` means images without distortion. What has no
calibration, or an encoding that is no image of depth, infra-red or colour, is left out.
"""

import logging
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.contract.text import is_name
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.ros2.cameras import CameraInfoError, Transforms, camera
from drivers.ros2.images import ImageError, decode, is_image
from drivers.ros2.messages import Bag

_log = logging.getLogger(__name__)
_TRANSFORMS = "/tf_static"
_TRANSPORTS = ("/compressed", "/compressedDepth")


@dataclass(frozen=True, eq=False)
class _Stream:
    """An image topic with its head, kind, calibration and coordinate frame."""

    topic: str
    sensor: str
    kind: Kind
    info: Any
    frame_id: str

    @property
    def rectified(self) -> bool:
        return "rect" in _base(self.topic).rpartition("/")[2]


class Ros2Bag:
    """The image topics of a bag; the rig's frame is that of the first depth images.

    Raises:
        ForeignRecordingError: unreadable bag, no calibrated depth images, cameras that are not connected by static
            transforms, or `rosbags` is not installed.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        if path.suffix == ".bag" and path.is_file():
            raise ForeignRecordingError(
                f"{path}: is a bag of ROS 1; `rosbags-convert --src {path.name} --dst {path.stem}` makes one of ROS 2, "
                "and layout realsense takes those that librealsense has recorded"
            )
        self._bag = Bag(path)
        topics = self._bag.topics()
        images = sorted((topic for topic, one in topics.items() if is_image(one.type) and one.count), key=_preference)
        infos = {_info_topic(topic) for topic in images} & {topic for topic, one in topics.items() if one.count}
        firsts = self._firsts({*images, *infos})
        self._streams = {stream.topic: stream for stream in self._find(images, firsts)}
        unstamped = [topic for topic in self._streams if _nanoseconds(firsts[topic].header.stamp) <= 0]
        self._is_stamped = not unstamped
        if unstamped:
            _log.warning("%s: %s has no time stamps: all are taken from when it was recorded", path, unstamped[0])
        self.total = sum(topics[topic].count for topic in self._streams)
        reference = next(stream for stream in self._streams.values() if stream.kind == Kind.DEPTH)
        try:
            transforms = Transforms(message.content for message in self._bag.messages({_TRANSFORMS}))
            self.cameras: Mapping[str, Camera] = {
                one.sensor: camera(one.info, one.rectified, transforms.between(reference.frame_id, one.frame_id))
                for one in self._streams.values()
            }
        except (CameraInfoError, ValueError) as error:
            raise ForeignRecordingError(f"{path}: {error}") from error

    def frames(self) -> Iterator[Frame]:
        """All images in order of recording. Host times are their stamps, or without any when they were recorded."""
        counts: Counter[str] = Counter()
        for message in self._bag.messages(self._streams):
            stream = self._streams[message.topic]
            try:
                kind, encoding, data = decode(message.content)
                size = data.shape[1], data.shape[0]
                lens = self.cameras[stream.sensor]
                if kind != stream.kind or size != (lens.width, lens.height):
                    taken = f"{lens.width} × {lens.height}"
                    raise ImageError(f"{kind} of {size[0]} × {size[1]} pixels is not what its camera takes, {taken}")
            except ImageError as error:
                raise ForeignRecordingError(f"{self._path}: {message.topic}: {error}") from error
            stamp = message.content.header.stamp
            yield self._frame(stream, stamp, message.time_ns, counts[message.topic], encoding, data)
            counts[message.topic] += 1

    def _frame(
        self, stream: _Stream, stamp: Any, time_ns: int, seq: int, encoding: str, data: NDArray[np.generic]
    ) -> Frame:
        is_depth, is_metres = stream.kind == Kind.DEPTH, encoding == "32FC1"
        if is_metres:
            metres = data.astype(np.float32)
            data = np.where(np.isfinite(metres) & (metres > 0), metres, np.float32(np.nan))
        return Frame(
            sensor=stream.sensor,
            stream=stream.kind.value,
            kind=stream.kind,
            data=data,
            encoding=encoding,
            t_host_ns=max(_nanoseconds(stamp) if self._is_stamped else time_ns, 0),
            t_arrival_ns=max(time_ns, 0),
            seq=seq,
            scale=0.001 if is_depth and not is_metres else 1.0,
            geometry=Geometry.Z if is_depth else Geometry.NONE,
            invalid=0.0 if is_depth and not is_metres else None,
            calib_id=self.cameras[stream.sensor].calib_id,
            undistorted=stream.rectified,
        )

    def _find(self, topics: list[str], firsts: Mapping[str, Any]) -> Iterator[_Stream]:
        """Image topics that can be used, with the first message of each topic.

        Raises:
            ForeignRecordingError: none of them has depth; says why each was left out.
        """
        found: dict[tuple[str, Kind], str] = {}
        left_out: list[str] = []
        for topic in topics:
            try:
                if _info_topic(topic) not in firsts:
                    raise ImageError(f"there is no {_info_topic(topic)}")
                kind, _, _ = decode(firsts[topic])
            except ImageError as error:
                left_out.append(f"{topic}: {error}")
                continue
            found.setdefault((_namespace(topic), kind), topic)
        if not any(kind == Kind.DEPTH for _, kind in found):
            kinds = (f"{topic} has images of kind {kind}, not 16UC1 or 32FC1" for (_, kind), topic in found.items())
            why = "; ".join([*left_out, *kinds]) or "there are no images"
            raise ForeignRecordingError(f"{self._path}: it has no depth images that can be used; {why}")
        if left_out:
            _log.warning("%s: left out: %s", self._path, "; ".join(left_out))
        names = _names({namespace for namespace, _ in found})
        for (namespace, kind), topic in found.items():
            yield _Stream(topic, names[namespace], kind, firsts[_info_topic(topic)], firsts[topic].header.frame_id)

    def _firsts(self, topics: set[str]) -> dict[str, Any]:
        """First message of each topic."""
        firsts: dict[str, Any] = {}
        for message in self._bag.messages(topics):
            firsts.setdefault(message.topic, message.content)
            if len(firsts) == len(topics):
                break
        return firsts


def _nanoseconds(stamp: Any) -> int:
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def _base(topic: str) -> str:
    """Name of the images, without the transport."""
    return next((topic.removesuffix(one) for one in _TRANSPORTS if topic.endswith(one)), topic)


def _namespace(topic: str) -> str:
    return _base(topic).rpartition("/")[0]


def _info_topic(topic: str) -> str:
    return f"{_namespace(topic)}/camera_info"


def _preference(topic: str) -> tuple[str, bool, str]:
    """Order of topics: of a camera's images, those without distortion first, and uncompressed ones."""
    return _namespace(topic), "rect" not in _base(topic).rpartition("/")[2], topic


def _names(namespaces: Collection[str]) -> dict[str, str]:
    """Names of heads: the last part of the namespace; all of it, or a number, where that is no name or not enough."""
    last = {namespace: namespace.rpartition("/")[2] for namespace in namespaces}
    whole = {namespace: namespace.strip("/").replace("/", "_") for namespace in namespaces}
    for names in (last, whole):
        if len(set(names.values())) == len(names) and all(map(is_name, names.values())):
            return names
    return {namespace: f"camera{number}" for number, namespace in enumerate(sorted(namespaces))}
