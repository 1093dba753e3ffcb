"""Recordings of a camera like a Femto Bolt, played by Orbbec's SDK, with faults in them."""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.drivers.conformance.bench import Fault
from tests.drivers.orbbec.bag import GEMINI_335, BagWriter, Stream, bag

LENS = (0.1, -0.2, 0.05, 0.01, 0.02, 0.03, 0.001, 0.002)
#: The SDK's projection, which tests compare with, applies this model of distortion and no other.
BROWN_CONRADY = 3
#: A quarter turn about z, and a translation [mm].
TO_COLOR = (0, -1, 0, 1, 0, 0, 0, 0, 1, -32.0, 2.0, 3.0)
DEPTH = Stream(3, 3, 8, "mono16", (32, 24), (25.0, 26.0, 15.5, 12.0), LENS, BROWN_CONRADY, TO_COLOR)
IR = Stream(1, 1, 8, "mono16", (32, 24), (25.0, 26.0, 15.5, 12.0), LENS, BROWN_CONRADY)
COLOR = Stream(2, 2, 22, "rgb8", (40, 30), (35.0, 36.0, 20.5, 14.5), LENS, BROWN_CONRADY)
LEFT = replace(DEPTH, number=6, frame=8, format=9, encoding="mono8")
RIGHT = replace(LEFT, number=7, frame=9)
#: Of the Gemini's two imagers [mm].
BASELINE_MM = 50.0
RATE_HZ = 50
#: Time of the first image [µs].
BEGIN_US = 2_000_000

#: Of the files, as the SDK counts them.
VERSION = struct.pack("<d", 2.1)
_ON, _OFF = struct.pack("<i", 1), struct.pack("<i", 0)


def write(path: Path, serial: str, images: int, fault: Fault = Fault.NONE, after: int = 0) -> None:
    """Writes exposures: depth 1000 + number in mm except in the first row, infra-red and colours their number."""
    with bag(path) as writer:
        writer.device(serial)
        writer.setting(0, VERSION)
        for stream in (DEPTH, IR, COLOR):
            writer.profile(stream, RATE_HZ)
        for number in range(images):
            broken = fault if number >= after else Fault.NONE
            if broken == Fault.UNPLUG:
                return
            # A stall is a gap of an hour.
            time_us = BEGIN_US + number * 1_000_000 // RATE_HZ + (3_600_000_000 if broken == Fault.STALL else 0)
            _exposure(writer, number, time_us, broken)


def write_stereo(path: Path, images: int) -> None:
    """Writes exposures of a Gemini: depth 10000 + number in units of 0.1 mm, both imagers 100 + number."""
    with bag(path) as writer:
        writer.device("G1", GEMINI_335, "Orbbec Gemini 335")
        # Version; the camera computes depth, the SDK nothing; speckles are removed; unit of depth [mm].
        for number, data in ((0, VERSION), (85, _ON), (3004, _OFF), (24, _ON), (176, struct.pack("<f", 0.1))):
            writer.setting(number, data)
        writer.baseline(BASELINE_MM)
        for stream in (DEPTH, LEFT, RIGHT):
            writer.profile(stream, RATE_HZ)
        for number in range(images):
            time_us = BEGIN_US + number * 1_000_000 // RATE_HZ
            writer.image(DEPTH, number, time_us, np.full(DEPTH.size[::-1], 10_000 + number, "<u2"))
            for stream in (LEFT, RIGHT):
                writer.image(stream, number, time_us, np.full(stream.size[::-1], 100 + number, np.uint8))


def _exposure(writer: BagWriter, number: int, time_us: int, fault: Fault) -> None:
    shapes = {stream: stream.size[::-1] for stream in (DEPTH, IR, COLOR)}
    depth = np.full(shapes[DEPTH], 1000 + number, "<u2")
    depth[0 if fault != Fault.NAN else slice(None)] = 0
    ir, color = np.full(shapes[IR], number, "<u2"), np.full((*shapes[COLOR], 3), number % 256, np.uint8)
    rows = {Fault.DROP: 10, Fault.WRONG_SIZE: 20}.get(fault, 24) if number % 2 else 24
    height = 20 if rows == 20 else 24
    writer.image(DEPTH, number, time_us, depth[:rows], height)
    writer.image(IR, number, time_us, ir)
    writer.image(COLOR, number, time_us + 5, color)
