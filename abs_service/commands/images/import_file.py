"""Writes what `abs-service import` reads: a recording as the recorder would have made it, without noise models."""

from collections import Counter
from collections.abc import Mapping
from itertools import chain
from pathlib import Path

from absmsg.v1.common_pb2 import Header
from rich.console import Console
from rich.progress import track

from abs_service.capture.mcap_writing import write_cameras, write_frame
from drivers.encoding.foreign_recording import ForeignRecording, ForeignRecordingError
from drivers.encoding.mcap_file import McapFile


def write(path: Path, rig: str, recording: ForeignRecording, rig_toml: bytes) -> Mapping[tuple[str, str], int]:
    """Writes a recording, in place of one that exists; returns the number of images by (sensor, stream).

    Raises:
        ForeignRecordingError: it cannot be read, or there is nothing in it.
        OSError: the file cannot be written.
    """
    frames = iter(recording.frames())
    first = next(frames, None)
    if first is None:
        raise ForeignRecordingError("there is no image in it")
    counts: Counter[tuple[str, str]] = Counter()
    with path.open("wb") as stream:
        file = McapFile(stream)
        if rig_toml:
            file.attach("rig.toml", "text/toml", rig_toml, first.t_host_ns)
        header = _header(rig, first.t_host_ns, 0)
        write_cameras(file, header, recording.cameras, first.t_host_ns)
        console = Console(stderr=True)
        for frame in track(chain([first], frames), "importing", recording.total, console=console, transient=True):
            write_frame(file, frame, _header(rig, frame.t_host_ns, frame.seq), frame.t_host_ns)
            counts[frame.key] += 1
        file.finish()
    return counts


def _header(rig: str, wall_ns: int, seq: int) -> Header:
    header = Header(t_host_ns=wall_ns, seq=seq, rig=rig, boot_id="import")
    header.stamp.FromNanoseconds(wall_ns)
    return header
