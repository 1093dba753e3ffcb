"""Offline reader of recordings: a deterministic sequence of frames and truths, without a clock or drops."""

import logging
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.sensor_model_pb2 import SensorModel
from google.protobuf.message import DecodeError

from calib.camera import Camera
from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.encoding import codec, encoded_image
from drivers.encoding.parsing import CodecError
from drivers.encoding.sensor_model import decode_camera
from drivers.replay.contents import Contents, RecordingError, scan
from drivers.replay.messages import messages

STATE_SCHEMA = DeformationState.DESCRIPTOR.full_name
MODEL_SCHEMA = SensorModel.DESCRIPTOR.full_name

_log = logging.getLogger(__name__)
_IMAGE = re.compile(r"/(?P<sensor>[^/]+)/(?P<stream>[^/]+)/image")


class Recording:
    """An MCAP file that abs-service recorded.

    A file whose writer was killed is read up to the truncation, and `truncated` is True.

    Args:
        path: of the file.
        contents: its index, if that is known; None to read it.

    Attributes:
        path: of the file.
        contents: its index.
        truncated: True if the file was not finished.
        damaged_chunks: number of corrupt chunks skipped in a file without index; with one, reading a corrupt chunk
            raises.
        duration_s: from the first to the last message [s].
        wall_offset_ns: wall-clock time minus `t_host_ns` of the first frame [ns]; 0 if there is none.
        counts: number of images by (sensor, stream).
        models: recorded sensor models, by sensor name.
        cameras: camera models, by sensor name.
        recalibrated: sensors of which another calibration follows within the file.
        config: the rig's configuration as TOML; "" if none was attached.
        unpaired: number of images and metadata messages without counterpart in the last pass of `frames`.
        malformed: number of frames and truths that were left out in the last pass, since they cannot be decoded.

    Raises:
        RecordingError: missing file, not MCAP, or not a recording of abs-service.
    """

    def __init__(self, path: Path, contents: Contents | None = None) -> None:
        contents = scan(path) if contents is None else contents
        self.path = path
        self.truncated = contents.truncated
        self.damaged_chunks = contents.damaged
        self.duration_s = (contents.end_ns - contents.start_ns) * 1e-9
        self.contents = contents
        self.wall_offset_ns = self._wall_offset()
        self.config = contents.attachments.get("rig.toml", b"").decode("utf-8", "replace")
        self.unpaired = self.malformed = 0
        self.counts = _image_counts(path, contents)
        self.models = self._read_models()
        self.cameras = {sensor: self._camera(model) for sensor, model in self.models.items()}
        self.recalibrated = [sensor for sensor, model in self.models.items() if self._is_followed(model)]

    def images(self, streams: Collection[tuple[str, str]] = ()) -> Iterator[Frame]:
        """`frames` without the truths."""
        return (item for item in self.frames(streams) if isinstance(item, Frame))

    def frames(self, streams: Collection[tuple[str, str]] = ()) -> Iterator[Frame | Truth]:
        """Frames and truths in order of time; each is decoded when it is reached.

        Malformed ones are left out and counted; a warning names the first.

        Args:
            streams: (sensor, stream) of the frames, others are not decoded; all if none is named.

        Raises:
            RecordingError: a corrupt chunk, or all frames are malformed.
        """
        self.malformed, count, first = 0, 0, ""
        waiting: dict[tuple[str, int, int], tuple[str, bytes]] = {}
        wanted = {*encoded_image.SCHEMAS, codec.INFO_SCHEMA, codec.TRUTH_SCHEMA}
        for topic, message in messages(self.path, self.contents, wanted):
            partner = None
            if topic.schema != codec.TRUTH_SCHEMA:
                stream = topic.name.rpartition("/")[0]
                if streams and tuple(stream[1:].split("/")) not in streams:
                    continue
                key = (stream, message.log_time, message.sequence)
                partner = waiting.pop(key, None)
                if partner is None:
                    waiting[key] = topic.schema, message.data
                    continue
            try:
                item = _decoded((topic.schema, message.data), partner)
            except CodecError as error:
                self.malformed += 1
                if self.malformed == 1:
                    first = f"{self.path}: {topic.name} at {message.log_time} ns: {error}"
                    _log.warning("%s; it is left out, and so are others like it", first)
                continue
            count += 1
            yield item
        self.unpaired = len(waiting)
        if first and not count:
            raise RecordingError(first)

    def first_frames(self) -> dict[tuple[str, str], Frame]:
        """The first frame of every stream that has one that can be read, by (sensor, stream); raises as `frames`."""
        found: dict[tuple[str, str], Frame] = {}
        for item in self.frames():
            if isinstance(item, Frame):
                found.setdefault(item.key, item)
            if len(found) == len(self.counts):
                break
        return found

    def rate_hz(self, first: Frame) -> float:
        """Mean rate of a stream from its first frame on, which may come long after the first message of others."""
        lasted_s = (self.contents.end_ns - self.wall_offset_ns - first.t_host_ns) * 1e-9
        return max(self.counts[first.key] - 1, 1) / max(lasted_s, 1e-3)

    def _wall_offset(self) -> int:
        for _, message in messages(self.path, self.contents, {codec.INFO_SCHEMA}):
            with suppress(DecodeError):  # counted when frames are read
                return message.log_time - FrameInfo.FromString(message.data).header.t_host_ns
        return 0

    def _read_models(self) -> dict[str, SensorModel]:
        """First sensor model of every sensor."""
        missing = {
            topic.name for topic in self.contents.topics.values() if topic.schema == MODEL_SCHEMA and topic.count
        }
        models: dict[str, SensorModel] = {}
        for topic, message in messages(self.path, self.contents, {MODEL_SCHEMA}) if missing else ():
            if topic.name in missing:
                missing.discard(topic.name)
                try:
                    models[topic.name.split("/")[1]] = SensorModel.FromString(message.data)
                except DecodeError as error:
                    raise RecordingError(f"{self.path}: {topic.name} holds no {MODEL_SCHEMA}: {error}") from error
            if not missing:
                break
        return models

    def _is_followed(self, model: SensorModel) -> bool:
        """True if the last calibration that the recorder attached is another one."""
        last = self.contents.attachments.get(f"calibration/{model.sensor}.json", b"")
        return b'"calib_id"' in last and f'"{model.calib_id}"'.encode() not in last

    def _camera(self, model: SensorModel) -> Camera:
        try:
            return decode_camera(model)
        except CodecError as error:
            raise RecordingError(f"{self.path}: {error}") from error


def _decoded(message: tuple[str, bytes], partner: tuple[str, bytes] | None) -> Frame | Truth:
    """A truth, or the frame of an image and its description, in whatever order they come; by schema and content."""
    if partner is None:
        return codec.decode_truth(message[1])
    image, info = (partner, message) if message[0] == codec.INFO_SCHEMA else (message, partner)
    return codec.decode(encoded_image.decode(*image), info[1])


def _image_counts(path: Path, contents: Contents) -> Mapping[tuple[str, str], int]:
    """Number of images per stream; raises if images have no FrameInfo."""
    names = {topic.name for topic in contents.topics.values()}
    counts: dict[tuple[str, str], int] = {}
    for topic in contents.topics.values():
        if topic.schema not in encoded_image.SCHEMAS:
            continue
        match = _IMAGE.fullmatch(topic.name)
        if not match or f"{topic.name.removesuffix('image')}info" not in names:
            raise RecordingError(
                f"{path}: topic {topic.name} holds images without absmsg.v1.FrameInfo, so this is no recording "
                "of abs-service; `abs-service import` makes one from image files"
            )
        counts[match["sensor"], match["stream"]] = topic.count
    if not counts:
        tracked = any(topic.schema == STATE_SCHEMA for topic in contents.topics.values())
        way_out = "; `abs-service replay --images` writes estimates and images" if tracked else ""
        raise RecordingError(f"{path}: there are no images in this file, its topics are {sorted(names)}{way_out}")
    return counts
