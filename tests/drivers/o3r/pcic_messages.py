"""Synthetic PCIC messages, written after the format description."""

import struct
from collections.abc import Sequence

import numpy as np

#: fx, fy, mx, my of one without distortion, and its skew.
PINHOLE = (9.0, 8.0, 4.5, 3.25, 0.0)
#: fx, fy, mx, my, skew, k1, k2, p1, p2, k3 of a head with 8 × 6 pixels.
LENS = (9.0, 8.0, 4.5, 3.25, 0.0, -0.2, 0.05, 0.001, -0.002, -0.006)


def tof_info(model: int = 1, lens: Sequence[float] = LENS, *, newer: bool = True) -> bytes:
    ours = np.zeros(32, "<f4")
    ours[: len(lens)] = lens
    parts = [
        struct.pack("<I", 4 if newer else 1),
        np.array([0.00025, 0.5, 0.1, 0.2, 0.3, 1, 2, 3, 0.1, 0.2, 0.3], "<f4").tobytes(),
        struct.pack("<I", 0) + np.pad(np.array(lens[:5], "<f4"), (0, 27)).tobytes(),
        struct.pack("<I", model) + ours.tobytes(),
    ]
    if newer:
        parts += [struct.pack("<3Q", 5, 6, 7), np.array([1e-4, 1e-3, 0, 41.5], "<f4").tobytes(), b"extrinsic2m\0" * 8]
    return b"".join(parts)


def chunk(
    kind: int,
    content: bytes,
    width: int,
    height: int,
    pixel_format: int,
    frame: int = 7,
    version: int = 3,
    time_ns: int | None = None,
) -> bytes:
    text = b'{"Version":"0.0.1"}\0' if version == 3 else b""
    fixed = 36 if version == 1 else 48
    size = fixed + len(text) + len(content)
    header = struct.pack("<9I", kind, size, fixed + len(text), version, width, height, pixel_format, 123_456, frame)
    if version > 1:
        seconds, nanoseconds = (1_700_000_000 + frame, 500) if time_ns is None else divmod(time_ns, 1_000_000_000)
        header += struct.pack("<3I", 0, seconds, nanoseconds)
    return header + text + content


def message(*chunks: bytes, on_the_wire: bool = False) -> bytes:
    body = b"star" + b"".join(chunks) + b"stop\r\n"
    return b"0000L%09d\r\n0000" % (len(body) + 4) + body if on_the_wire else b"0000" + body


def exposure(frame: int = 7) -> bytes:
    """A message of 8 × 6 pixels: digit 100 · row + column of distance and a few of the rest."""
    distance = (100 * np.arange(6)[:, None] + np.arange(8)).astype("<u2")
    return message(
        chunk(100, distance.tobytes(), 8, 6, 2, frame),
        chunk(105, (distance // 50).tobytes(), 8, 6, 2, frame),
        chunk(101, (distance * 10).tobytes(), 8, 6, 2, frame),
        chunk(300, np.full((6, 8), 16, "u1").tobytes(), 8, 6, 0, frame, version=2),
        chunk(420, tof_info(), 8, 6, 0, frame, version=2),
    )
