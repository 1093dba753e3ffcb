"""Bytes of recordings whose images are compressed, and processor time of a recorder that compresses them.

The rig of today is a depth camera of 640 × 480 and a colour camera of 1280 × 720 at 30 Hz, simulated, moving.

Statistic: bytes of the finished recording over those of one with raw images in lz4 chunks; processor time of one
thread that encodes and writes one set of images, times 30 Hz, by its median over all sets in single passes.
Goals: at most 40 % of lossless images, of lossless images whose colour camera delivers a mosaic, of JPEG colours,
and of lossless images of real cameras; at most 0.25 cores. Set by the users before any codec was measured; the
codec was then chosen, and the level of Zstandard set, on the first six of these images and on those of the real
cameras.
Seeds: one sequence, with the context's seed + 1.
"""

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from abs_service.bus import keys
from abs_service.recording.recording_file import RecordingFile
from abs_service.report.content import Cell, Column, Section, Table
from drivers.contract.frame import Frame
from drivers.encoding import codec, encoded_image
from drivers.encoding.encoded_image import ImageCodec
from evaluation.experiment import Context, Findings, at_most
from evaluation.service.image_codecs import images

TITLE = "Image codecs: bytes and processor time of recordings"

#: Share of today's bytes, and of one core.
SHARE, CORES = 0.40, 0.25
RATE_HZ = 30.0


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        frames: images of each stream.
    """

    frames: int = 60


QUICK = Settings(3)

_COLUMNS = (
    Column("rig"), Column("codec"), Column("raw images", "MB/s", ".1f"), Column("recording", "MB/s", ".1f"),
    Column("of today's", "%", ".1f"), Column("processor, median", "cores", ".2f"),
    Column("processor, 95 %", "cores", ".2f"),
)  # fmt: skip


@dataclass(frozen=True)
class Recorded:
    """Cost of a recording.

    Attributes:
        size: of the file [bytes].
        set_s: processor time of every set of images [s].
    """

    size: int
    set_s: Sequence[float]


def run(settings: Settings, context: Context) -> Findings:
    """Records the rig of today, and one of real cameras, with and without compressed images."""
    simulated = images.streams(images.simulated(context.seed + 1, settings.frames))
    real = images.recorded(context.data, settings.frames)
    recorders, shares, cores = _recorders(simulated, real, context)
    reason = (
        "Noise of 2.5 levels alone takes 42 % of the simulated colours' bytes, and predicting from noise adds to it."
    )
    goals = tuple(
        at_most(f"Recording, {name}", share, SHARE, reason=reason if name == _LOSSLESS else "")
        for name, share in shares.items()
    ) + tuple(at_most(f"Recorder's thread, {name}", value, CORES, "cores") for name, value in cores.items())
    table = Table("Encoded and written by one thread", _COLUMNS, recorders)
    values = {"recordings": recorders, "shares": shares, "cores": cores}
    return Findings(goals, (Section("Recordings", (table,)),), values)


_LOSSLESS = "depth and colour, lossless"


def _recorders(
    simulated: Mapping[str, list[Frame]], real: Mapping[str, list[Frame]], context: Context
) -> tuple[tuple[tuple[Cell, ...], ...], dict[str, float], dict[str, float]]:
    """Rows of the table, shares of today's bytes, and processors."""
    depth, color = simulated["simulated tof/depth"], simulated["simulated color/color"]
    rigs = {
        _LOSSLESS: (depth, color, color, ImageCodec.LOSSLESS),
        "depth and mosaic, lossless": (depth, color, simulated["simulated bayer/bayer"], ImageCodec.LOSSLESS),
        "depth lossless, colour JPEG": (depth, color, color, ImageCodec.JPEG),
    }
    if {"RealSense depth", "Azure Kinect color"} <= real.keys():
        single = real["RealSense depth"], real["Azure Kinect color"]
        depth, color = ([frames[k % len(frames)] for k in range(len(depth))] for frames in single)
        rigs["real cameras, lossless"] = (depth, color, color, ImageCodec.LOSSLESS)
    rows, shares, cores = [], {}, {}
    for name, (depths, colors, delivered, chosen) in rigs.items():
        context.progress(name)
        today = record((depths, colors), ImageCodec.RAW, ImageCodec.RAW)
        made = record((depths, delivered), ImageCodec.LOSSLESS, chosen)
        raw = sum(frame.data.nbytes for frame in (*depths, *delivered))
        median, late = (RATE_HZ * float(np.quantile(made.set_s, share)) for share in (0.5, 0.95))
        megabytes = RATE_HZ / len(depths) * 1e-6
        shares[name], cores[name] = made.size / today.size, median
        rows.append((name, chosen.value, raw * megabytes, made.size * megabytes, 100 * shares[name], median, late))
        before = (RATE_HZ * float(np.quantile(today.set_s, share)) for share in (0.5, 0.95))
        was = sum(frame.data.nbytes for frame in (*depths, *colors))
        rows.append((name, "raw, lz4 (today)", was * megabytes, today.size * megabytes, 100.0, *before))
    return tuple(rows), shares, cores


def record(streams: Sequence[Sequence[Frame]], depth: ImageCodec, color: ImageCodec) -> Recorded:
    """Records sets of images as the recorder does, without its queue."""
    encode, set_s = encoded_image.encoder(depth, color), []
    with tempfile.TemporaryDirectory() as folder:
        file = RecordingFile(Path(folder) / "rig.mcap", 0, {})
        for seq, frames in enumerate(zip(*streams), 1):
            published = [images.as_stream(frame, f"s{number}", seq) for number, frame in enumerate(frames)]
            payloads = [codec.encode_image(frame, seq) for frame in published]
            begin_s = time.thread_time()
            for frame, payload in zip(published, payloads):
                file.write(keys.image(frame.sensor, frame.stream), *encode(payload), frame.t_host_ns, seq)
            set_s.append(time.thread_time() - begin_s)
        return Recorded(file.finish({}).stat().st_size, set_s)
