"""Damaged, unsupported and hostile .sens files: each is refused by name, field, value and what is allowed."""

import os
import struct
import tracemalloc
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.sens.recording import SensRecording
from tests.drivers.encoding.test_image_size import png
from tests.drivers.sens import sens_file
from tests.drivers.sens.sens_file import JPEG, OCCI, RAW, SensFile, shots

SKEWED = sens_file.intrinsic(7, 8, 3.5, 2.5) + np.eye(4, k=1)
MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])


def refused(path: Path, content: bytes) -> str:
    path.write_bytes(content)
    with pytest.raises(ForeignRecordingError) as error:
        list(SensRecording(path).frames())
    return str(error.value)


def with_images(color: bytes, depth: bytes, sizes: tuple[int, int] | None = None, **changes: Any) -> bytes:
    """One intact frame, and one with these contents."""
    file = SensFile(shots(1), count=2, inertial=0, **changes)
    intact = file.content().removesuffix(struct.pack("<Q", 0))
    return intact + sens_file.frame(shots(1)[0], color, depth, sizes)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"version": 3}, "version = 3: only 4 can be read"),
        ({"name": b"x" * 2000}, "the sensor's name has 2000 bytes, 1024 are allowed"),
        ({"depth_compression": OCCI}, "depth_compression_type = 2 (occi_ushort): only 0 (raw_ushort), 1 (zlib_ushort)"),
        ({"depth_compression": -1}, "depth_compression_type = -1 (unknown): only"),
        ({"depth_compression": 9}, "depth_compression_type = 9: only"),
        ({"color_compression": -1}, "color_compression_type = -1 (unknown): only 0 (raw), 1 (png), 2 (jpeg)"),
        ({"depth_shift": 0.0}, "depth_shift = 0.0: must be from 1 to 1e+06 units per metre"),
        ({"depth_shift": np.nan}, "depth_shift = nan: must be"),
        ({"count": 0}, "num_frames = 0: must be from 1 to 16777216; a recorder that was interrupted leaves 0"),
        ({"count": 2**64 - 1}, "num_frames = 18446744073709551615: must be from 1"),
        ({"count": 3}, "frame 2 of 3 is cut off"),
        ({"depth_size": (0, 6)}, "depth images: width = 0: must be"),
        ({"depth_size": (2**32 - 1, 2**32 - 1)}, "4294967295 × 4294967295 pixels: 67108864 pixels are allowed"),
        ({"color_size": (10_000, 10_000)}, "color images of 10000 × 10000 pixels: 67108864 pixels are allowed"),
        ({"intrinsic_depth": np.eye(4)}, "intrinsic_depth = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: the"),
        ({"intrinsic_depth": SKEWED}, "must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]"),
        ({"intrinsic_depth": np.full((4, 4), np.nan)}, "intrinsic_depth = [[nan"),
        ({"intrinsic_color": sens_file.intrinsic(-9, 9, 4, 4)}, "color images: fx = -9.0: must be"),
        ({"extrinsic_depth": np.zeros((4, 4))}, "extrinsic_depth: must be a rotation and a translation [m]"),
        ({"extrinsic_color": MIRROR}, "extrinsic_color: must be a rotation"),
        ({"extrinsic_color": np.full((4, 4), -np.inf)}, "extrinsic_color: must be a rotation"),
    ],
)
def test_a_header_that_cannot_be_used_is_named(tmp_path: Path, changes: dict[str, Any], complaint: str) -> None:
    message = refused(tmp_path / "x.sens", SensFile(shots(2), inertial=0, **changes).content())
    assert message.startswith(f"{tmp_path / 'x.sens'}: ")
    assert complaint in message


@pytest.mark.parametrize(
    ("color", "depth", "changes", "complaint"),
    [
        (b"", zlib.compress(bytes(94)), {}, "depth of frame 1: 8 × 6 pixels need two bytes each, there are 94"),
        (b"", zlib.compress(bytes(97)), {}, "depth of frame 1: 8 × 6 pixels need two bytes each, the zlib stream has"),
        (b"", zlib.compress(bytes(96))[:-5], {}, "depth of frame 1: the zlib stream is truncated"),
        (b"", b"no zlib", {}, "depth of frame 1: this is no zlib stream"),
        (
            b"",
            bytes(95),
            {"depth_compression": RAW},
            "depth of frame 1: 8 × 6 pixels need two bytes each, there are 95",
        ),
        (bytes(9), b"", {"color_compression": RAW}, "color of frame 1: 10 × 8 pixels need three bytes each"),
        (b"no image", b"", {}, "color of frame 1: no image of a known format"),
        (png(30_000, 30_000), b"", {}, "color of frame 1: more than the 67108864 pixels that are allowed"),
        (png(11, 8), b"", {}, "color of frame 1: the image has 11 × 8 pixels, the header says 10 × 8"),
        (png(10, 8), b"", {}, "color of frame 1: it cannot be decoded"),
    ],
)
def test_an_image_that_cannot_be_used_is_named(
    tmp_path: Path, color: bytes, depth: bytes, changes: dict[str, Any], complaint: str
) -> None:
    message = refused(tmp_path / "x.sens", with_images(color, depth, **changes))
    assert message.startswith(f"{tmp_path / 'x.sens'}: ")
    assert complaint in message


def test_a_jpeg_without_its_end_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (8, 10, 3), dtype=np.uint8)
    cut = cv2.imencode(".jpg", noise)[1].tobytes()[:-20]
    assert "the image is truncated" in refused(tmp_path / "x.sens", with_images(cut, b"", color_compression=JPEG))


@pytest.mark.parametrize(
    ("sizes", "complaint"),
    [
        ((2**63, 0), "frame 1 of 2: color_size_bytes = 9223372036854775808: 268435456 are allowed"),
        ((0, 2**28 + 1), "frame 1 of 2: depth_size_bytes = 268435457: 268435456 are allowed"),
        ((500, 500), "frame 1 of 2 is cut off: it ends at byte"),
    ],
)
def test_sizes_that_no_file_has_are_refused_before_anything_is_read(
    tmp_path: Path, sizes: tuple[int, int], complaint: str
) -> None:
    message = refused(tmp_path / "x.sens", with_images(b"", b"", sizes))
    assert complaint in message
    assert "the frames before it are whole: 1" in message


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    bomb = zlib.compress(bytes(100_000_000), 9)
    tracemalloc.start()
    try:
        assert "the zlib stream has more" in refused(tmp_path / "x.sens", with_images(b"", bomb))
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()


def test_a_file_that_ends_anywhere_is_refused(tmp_path: Path) -> None:
    content = SensFile(shots(2), inertial=0).content().removesuffix(struct.pack("<Q", 0))
    for end in range(0, len(content), 7):
        message = refused(tmp_path / "x.sens", content[:end])
        assert "ends within the header" in message or "is cut off" in message


def test_what_lies_before_the_damage_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "x.sens"
    path.write_bytes(with_images(b"", b"", (500, 500)))
    recording = SensRecording(path, lambda number: number < 1)
    assert [frame.seq for frame in recording.frames()] == [0, 0]


@pytest.mark.parametrize(
    ("wanted", "taken", "complaint"),
    [
        (lambda number: number > 8, shots(2), "none of the frames that were asked for; there are 0 to 1"),
        (lambda number: True, [sens_file.Shot(None, shots(1)[0].color)], "there is no depth image"),
    ],
)
def test_a_file_without_the_images_is_refused(tmp_path: Path, wanted: Any, taken: Any, complaint: str) -> None:
    (tmp_path / "x.sens").write_bytes(SensFile(taken).content())
    with pytest.raises(ForeignRecordingError, match=complaint):
        SensRecording(tmp_path / "x.sens", wanted)


def test_what_is_no_file_is_refused_with_its_name(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.sens")
    for name, complaint in (("nothing.sens", "No such file"), (".", "directory"), ("pipe.sens", "no regular file")):
        with pytest.raises(ForeignRecordingError, match=f"cannot be read: .*{complaint}"):
            SensRecording(tmp_path / name)


def test_another_files_bytes_are_refused(tmp_path: Path) -> None:
    assert "or this is no .sens file" in refused(tmp_path / "x.sens", b"plainly a text, and a long one\n" * 20)


def test_damaged_bytes_are_read_or_refused(tmp_path: Path) -> None:
    content, rng, refusals = SensFile(shots(3)).content(), np.random.default_rng(5), 0
    for _ in range(150):
        changed = bytearray(content)
        for position in rng.integers(len(content), size=4):
            changed[position] = int(rng.integers(256))
        (tmp_path / "x.sens").write_bytes(changed)
        try:
            list(SensRecording(tmp_path / "x.sens").frames())
        except ForeignRecordingError:
            refusals += 1
    assert refusals > 0
