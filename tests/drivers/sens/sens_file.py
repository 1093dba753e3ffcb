"""Writer of .sens files, field by field as ScanNet's `sensorData.h`; knows nothing of the reader."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

RAW, PNG, JPEG = 0, 1, 2
ZLIB, OCCI = 1, 2
#: Colour is the base frame; depth is 25 mm beside it, turned by 5° about x.
TURN = cv2.Rodrigues(np.array([np.radians(5), 0, 0]))[0]
DEPTH_TO_COLOR = np.block([[TURN, np.array([[0.025], [0.001], [-0.002]])], [np.zeros((1, 3)), np.ones((1, 1))]])
#: ScanNet's for a frame whose pose was not found.
LOST = np.full((4, 4), -np.inf)


def intrinsic(fx: float, fy: float, mx: float, my: float) -> NDArray[np.float64]:
    """The matrix (4, 4) of `makeIntrinsicMatrix`."""
    matrix = np.eye(4)
    matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2] = fx, fy, mx, my
    return matrix


@dataclass
class Shot:
    """A frame: depth (height, width) and colours (height, width, 3), RGB; None for an image that is missing."""

    depth: NDArray[np.uint16] | None
    color: NDArray[np.uint8] | None
    depth_us: int = 0
    color_us: int = 0
    pose: NDArray[Any] = field(default_factory=lambda: LOST)


@dataclass
class SensFile:
    """All fields of a file."""

    shots: Sequence[Shot]
    version: int = 4
    name: bytes = b"StructureSensor"
    intrinsic_color: Any = field(default_factory=lambda: intrinsic(9, 10, 4.5, 3.5))
    extrinsic_color: Any = field(default_factory=lambda: np.eye(4))
    intrinsic_depth: Any = field(default_factory=lambda: intrinsic(7, 8, 3.5, 2.5))
    extrinsic_depth: Any = field(default_factory=lambda: DEPTH_TO_COLOR)
    color_compression: int = PNG
    depth_compression: int = ZLIB
    color_size: tuple[int, int] = (10, 8)
    depth_size: tuple[int, int] = (8, 6)
    depth_shift: float = 1000.0
    count: int | None = None
    inertial: int = 2

    def header(self) -> bytes:
        """All before the frames."""
        matrices = (self.intrinsic_color, self.extrinsic_color, self.intrinsic_depth, self.extrinsic_depth)
        count = len(self.shots) if self.count is None else self.count
        return b"".join(
            (
                struct.pack("<I", self.version),
                struct.pack("<Q", len(self.name)) + self.name,
                *(np.asarray(matrix).astype("<f4").tobytes() for matrix in matrices),
                struct.pack("<ii", self.color_compression, self.depth_compression),
                struct.pack("<II", *self.color_size) + struct.pack("<II", *self.depth_size),
                struct.pack("<f", self.depth_shift) + struct.pack("<Q", count),
            )
        )

    def content(self) -> bytes:
        """The file, with IMU frames at its end."""
        frames = (frame(shot, self.color(shot.color), self.compressed_depth(shot.depth)) for shot in self.shots)
        inertial = struct.pack("<15dQ", *range(15), 7) * self.inertial
        return self.header() + b"".join(frames) + struct.pack("<Q", self.inertial) + inertial

    def color(self, image: NDArray[np.uint8] | None) -> bytes:
        """A colour image as it lies in the file."""
        if image is None:
            return b""
        if self.color_compression not in {PNG, JPEG}:
            return image.tobytes()
        suffix = ".png" if self.color_compression == PNG else ".jpg"
        return cv2.imencode(suffix, np.ascontiguousarray(image[..., ::-1]))[1].tobytes()

    def compressed_depth(self, image: NDArray[np.uint16] | None) -> bytes:
        """A depth image as it lies in the file."""
        content = b"" if image is None else image.astype("<u2").tobytes()
        return zlib.compress(content) if content and self.depth_compression == ZLIB else content


def frame(shot: Shot, color: bytes, depth: bytes, sizes: tuple[int, int] | None = None) -> bytes:
    """A frame with contents of images, and the sizes that it claims."""
    stamps = struct.pack("<QQ", shot.color_us, shot.depth_us)
    claimed = struct.pack("<QQ", *(sizes or (len(color), len(depth))))
    return shot.pose.astype("<f4").tobytes() + stamps + claimed + color + depth


def shots(count: int, *, depth_us: int = 0, color_us: int = 0, period_us: int = 0) -> list[Shot]:
    """Frames of different images: depth k has 1000 + k and more, without return in its first pixel."""
    made = []
    for k in range(count):
        depth = (1000 + k + np.arange(48).reshape(6, 8)).astype(np.uint16)
        depth[0, 0] = 0
        color = np.zeros((8, 10, 3), np.uint8)
        color[...] = (200, 100, 10 + k)
        made.append(Shot(depth, color, depth_us + k * period_us, color_us + k * period_us))
    return made
