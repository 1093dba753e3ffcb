"""Writes a recording as Orbbec's SDK does, to be played by the SDK itself.

A ROS 1 bag with Orbbec's own messages (OrbbecSDK_v2, src/media/ros and 3rdparty/rosbag/src/msgs): one `deviceInfo`, one
`streamProfileType_N` for each stream, `property` for settings, and images `sensor_N/frameType_N` with times in µs.
"""

import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

#: Checksums of the messages, as the SDK compares them; those of its own messages are not computed from anything.
_MESSAGES: Mapping[str, tuple[str, str]] = {
    "deviceInfo": ("custom_msg/OBDeviceInfo", "afef5328bb4abebd1a309e1ea8b26b3a"),
    "streamProfileType": ("custom_msg/OBStreamProfileInfo", "0123456789abcdef0123456789abcdef"),
    "disparityParam": ("custom_msg/OBDisparityParam", "abcdef0123456789abcdef0123456789"),
    "property": ("custom_msg/OBProperty", "0123456789abcdef0123456789abcdef"),
    "sensor": ("sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743"),
}
#: Orbbec's USB vendor number, and the product numbers of two cameras.
VENDOR, FEMTO_BOLT, GEMINI_335 = 0x2BC5, 0x066B, 0x0800


@dataclass(frozen=True)
class Stream:
    """One recorded stream.

    Attributes:
        number: of its type, in the SDK's enumerations of sensors and streams: IR 1, colour 2, depth 3, left IR 6.
        frame: number in the SDK's enumeration of frames.
        format: number in the SDK's enumeration of formats.
        encoding: the name of it in images.
        size: width and height [px].
        matrix: fx, fy, cx, cy [px].
        distortion: k1 … k6, p1, p2.
        model: number of the distortion model.
        to_color: rotation (9 numbers, by rows) and translation [mm] from depth to colour; read from depth alone.
    """

    number: int
    frame: int
    format: int
    encoding: str
    size: tuple[int, int]
    matrix: tuple[float, ...]
    distortion: tuple[float, ...] = (0.0,) * 8
    model: int = 0
    to_color: tuple[float, ...] = (1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)


class BagWriter:
    """An open bag."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._connections: dict[str, Any] = {}

    def device(self, serial: str, product: int = FEMTO_BOLT, name: str = "Orbbec Femto Bolt") -> None:
        texts = [_text(text) for text in ("uid", serial, "1.1.2", "1.0", "2.0.0", "USB3.1")]
        names = _text(name) + _text(name) + _text("asic")
        body = names + struct.pack("<HH", VENDOR, product) + b"".join(texts) + struct.pack("<HB", 0, 0)
        self._write("/cam/deviceInfo", "deviceInfo", 1_000_000, body + _text("") + _text(""))

    def profile(self, stream: Stream, fps: int = 30) -> None:
        body = struct.pack("<BB12f", stream.number, stream.format, *stream.to_color)
        body += struct.pack("<HHH4f8fB", *stream.size, fps, *stream.matrix, *stream.distortion, stream.model)
        self._write(f"/cam/streamProfileType_{stream.number}", "streamProfileType", 1_000_000, body)

    def baseline(self, baseline_mm: float) -> None:
        body = struct.pack("<ddfdBffBfiiB", 0, 0, baseline_mm, 25.0, 16, 1.0, 0, 0, 0, 0, 0, 1)
        self._write("/cam/disparityParam", "disparityParam", 1_000_000, body)

    def setting(self, number: int, data: bytes) -> None:
        self._write("/cam/property", "property", 1_000_000, struct.pack("<I", number) + _blob(data) + _size(data))

    def image(self, stream: Stream, seq: int, time_us: int, pixels: np.ndarray, height: int = 0) -> None:
        width, height = stream.size[0], height or stream.size[1]
        data = pixels.tobytes()
        body = struct.pack("<II", height, width) + _text(stream.encoding)
        body += struct.pack("<BI", 0, len(data) // height) + _blob(data)
        body += struct.pack("<fQQQQ", 0.0, seq, time_us, time_us, time_us)
        body += _blob(b"") + _size(b"") + struct.pack("<B", 8 * pixels.itemsize)  # no metadata
        self._write(f"/cam/sensor_{stream.number}/frameType_{stream.frame}", "sensor", time_us, body)

    def _write(self, topic: str, kind: str, time_us: int, body: bytes) -> None:
        if topic not in self._connections:
            name, checksum = _MESSAGES[kind]
            named = name.replace("/", "/msg/")
            self._connections[topic] = self._writer.add_connection(topic, named, msgdef="uint8 x\n", md5sum=checksum)
        header = struct.pack("<III", 0, *divmod(time_us * 1000, 1_000_000_000)) + _text("")
        self._writer.write(self._connections[topic], time_us * 1000, header + body)


@contextmanager
def bag(path: Path) -> Iterator[BagWriter]:
    """A new bag, complete at the end."""
    from rosbags.rosbag1 import Writer

    with Writer(path) as writer:
        yield BagWriter(writer)


def _text(text: str) -> bytes:
    return _blob(text.encode())


def _blob(data: bytes) -> bytes:
    return _size(data) + data


def _size(data: bytes) -> bytes:
    return struct.pack("<I", len(data))
