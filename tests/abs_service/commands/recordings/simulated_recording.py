"""Recordings of any simulated rig, written without processes and clocks."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from absmsg.v1.common_pb2 import Header

from abs_service.capture import mcap_writing
from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.encoding import codec
from drivers.encoding.encoded_image import ImageEncoder, unchanged
from drivers.encoding.mcap_file import McapFile
from drivers.simulated.sensors.exposure import Head

#: Wall-clock time at which the simulation starts [ns].
WALL_NS = 1_700_000_000_000_000_000


class Recordable(Protocol):
    """Source of a recording: a simulation, or a modified one."""

    @property
    def heads(self) -> Mapping[str, Head]: ...
    def frames(self, k: int) -> list[Frame]: ...
    def truths(self, k: int) -> list[Truth]: ...


def write_take(
    path: Path,
    simulation: Recordable,
    exposures: Iterable[int],
    names: Mapping[str, str],
    toml: str = "",
    finish: bool = True,
    encode_image: ImageEncoder = unchanged,
    add: Callable[[McapFile, int], None] = lambda file, k: None,
) -> Path:
    """Records exposures of a simulation.

    Args:
        path: file to write.
        simulation: what is recorded.
        exposures: numbers of the exposures.
        names: heads that are recorded, and what their sensors are called.
        toml: configuration of the rig; none is attached if it is empty.
        finish: whether the recording ends as it should.
        encode_image: as the recorder's.
        add: writes more after each exposure.
    """
    with path.open("wb") as stream:
        file = McapFile(stream, chunk_size=400_000)
        if toml:
            file.attach("rig.toml", "text/toml", toml.encode(), WALL_NS)
        cameras = {name: simulation.heads[head].camera for head, name in names.items()}
        mcap_writing.write_cameras(file, Header(rig="demo"), cameras, WALL_NS)
        for k in exposures:
            frames, truths = simulation.frames(k), simulation.truths(k)
            for truth in truths:
                write_truth(file, truth)
            for frame in frames:
                if frame.sensor in names:
                    write_frame(file, replace(frame, sensor=names[frame.sensor]), encode_image)
            add(file, k)
        file.finish() if finish else file.flush()
    return path


def write_truth(file: McapFile, truth: Truth) -> None:
    """Writes the truth of an exposure."""
    payload = codec.encode_truth(truth, Header(rig="demo", seq=truth.seq))
    file.write("/sim/truth", codec.TRUTH_SCHEMA, payload, WALL_NS + truth.t_host_ns, truth.seq)


def write_frame(file: McapFile, frame: Frame, encode_image: ImageEncoder = unchanged) -> None:
    """Writes an image and its metadata."""
    header = Header(rig="demo", seq=frame.seq)
    mcap_writing.write_frame(file, frame, header, WALL_NS + frame.t_host_ns, encode_image)
