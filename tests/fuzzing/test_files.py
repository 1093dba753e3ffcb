"""Damaged and hostile files of every kind: each is read, or refused by an error that is meant for people.

Seconds per kind: environment variable ABS_FUZZ_SECONDS. Without it, the same few examples in every run.
"""

import io
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from abs_service.calibration.files import exchange, target_file
from abs_service.commands.images import foreign_cameras, open3d_folder
from abs_service.commands.parts import camera_file
from abs_service.commands.parts.options import OptionError
from abs_service.config import ConfigError, load, load_calibration
from abs_service.export import viewers
from abs_service.export.errors import ExportError
from abs_service.recording.recovery import RecoveryError, recover
from calib.camera import Camera
from calib.formats.content import Hints
from calib.noise.base import NoiseError
from calib.noise.fit import maps
from drivers.contract.device import DeviceError
from drivers.contract.text import printable
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.encoding.mcap_file import McapFile
from drivers.image_folder import image_file
from drivers.image_folder.listing import ImageFolderError
from drivers.replay.contents import scan
from drivers.replay.messages import messages
from drivers.sens.recording import SensRecording
from tests.drivers.replay import recordings
from tests.drivers.sens.sens_file import SensFile, shots

SECONDS = float(os.environ.get("ABS_FUZZ_SECONDS", "0"))
#: What is put into a file: numbers that say sizes, and what nests.
PARTS = (
    *(b"\xff" * 4, b"\xff" * 8, b"\x00" * 8, b"\x7f" + b"\xff" * 7, b"\x00", b"\x1b[2J"),
    *(part * 400 for part in (b"[", b"{", b"- ", b"a.", b"<a>")),
    *(b"1e999", b"-1", b"nan", b"null", b'"', b"\n", b"=", b"[[", b"&a", b"*a", b"!!python/name:os.system"),
)
SUFFIXES = (".png", ".jpg", ".tiff", ".pgm", ".bmp", ".webp")
CAMERA = Camera(640, 480, 500.0, 501.0, 319.5, 239.5)
INTRINSICS = b'{"width": 4, "height": 3, "intrinsic_matrix": [4, 0, 0, 0, 4, 0, 1.5, 1, 1], "depth_scale": 1000}'
FORMATS = ("kalibr", "ros", "opencv", "depthai", "mrcal", "colmap")


@dataclass(frozen=True)
class Target:
    """A kind of file: an intact one, what reads it, and the errors that it may raise."""

    name: str
    valid: bytes
    read: Callable[[Path], object]
    errors: tuple[type[Exception], ...]


def recording() -> bytes:
    stream = io.BytesIO()
    file = McapFile(stream)
    for sensor, camera in recordings.CAMERAS.items():
        recordings.write_model(file, sensor, camera)
    for item in recordings.recorded(2):
        recordings.write_item(file, item)
    file.attach("rig.toml", "text/toml", b"version = 1\n", recordings.WALL_NS)
    file.finish()
    return stream.getvalue()


def replayed(path: Path) -> list[object]:
    contents = scan(path)
    return list(messages(path, contents, {topic.schema for topic in contents.topics.values()}))


def exported(path: Path) -> None:
    viewers.export(path, scan(path), io.BytesIO(), 0.0, lambda: None)


def scanned(path: Path) -> list[object]:
    return list(SensRecording(path).frames())


def npz() -> bytes:
    stream = io.BytesIO()
    np.savez_compressed(stream, distances=np.arange(2.0), amplitudes=np.arange(2.0))
    return stream.getvalue()


def cameras(path: Path) -> object:
    return foreign_cameras.load(path, (4, 3), True)


def array() -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.arange(12, dtype=np.float32).reshape(3, 4))
    return stream.getvalue()


def picture(suffix: str) -> bytes:
    return cv2.imencode(suffix, np.arange(600, dtype=np.uint8).reshape(20, 30))[1].tobytes()


def of_format(name: str) -> Target:
    text = exchange.write(Path("x.yaml"), name, {"color": CAMERA}).text.encode()
    return Target(
        name,
        text,
        lambda path: exchange.read(path, path.read_text(encoding="utf-8"), name, Hints("x")),
        (exchange.ExchangeError, UnicodeDecodeError),
    )


RIG = (Path(__file__).parents[2] / "abs_service" / "config" / "demo.toml").read_bytes()
TABLE = b"width = 640\nheight = 480\nfx = 500.0\nfy = 500.0\ncx = 320.0\ncy = 240.0\n"
CALIBRATION = b'version = 1\nname = "x"\n[provenance]\ncommand = "x"\ndate = "x"\nversion = "x"\n[sensors.tof.camera]\n'
BOARD = b'kind = "charuco"\ncolumns = 5\nrows = 7\nsquare_mm = 30.0\nmarker_mm = 22.0\n'
TARGETS = (
    Target("configuration", RIG, load, (ConfigError,)),
    Target("calibration", CALIBRATION + TABLE, load_calibration, (ConfigError,)),
    Target("camera file", b"[depth]\n" + TABLE, camera_file.load, (camera_file.CameraFileError,)),
    Target("intrinsics of Open3D", INTRINSICS, open3d_folder.read, (camera_file.CameraFileError,)),
    Target("board", BOARD, target_file.read, (target_file.TargetFileError,)),
    Target("noise maps", npz(), lambda path: maps.load(path, set()), (NoiseError,)),
    Target("recording", recording(), replayed, (DeviceError,)),
    Target("recovery", recording(), recover, (RecoveryError,)),
    Target("scan", SensFile(shots(3)).content(), scanned, (ForeignRecordingError,)),
    Target("export", recording(), exported, (ExportError, DeviceError)),
    Target("array", array(), image_file.read, (ImageFolderError,)),
    Target("matrix", b"4.0 0 1.5\n0 4.0 1\n0 0 1\n", cameras, (camera_file.CameraFileError, OptionError)),
    *(Target(suffix, picture(suffix), image_file.read, (ImageFolderError,)) for suffix in SUFFIXES),
    *map(of_format, FORMATS),
)  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn, valid: bytes) -> bytes:
    """A file with a few places overwritten, with parts put in, cut out or repeated."""
    data = bytearray(valid)
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(data)))
        end = min(len(data), begin + draw(st.integers(0, 40)))
        part = draw(st.sampled_from(PARTS) | st.binary(max_size=8))
        match draw(st.integers(0, 3)):
            case 0:
                data[begin : begin + len(part)] = part
            case 1:
                data[begin:begin] = part
            case 2:
                del data[begin:end]
            case 3:
                data[begin:begin] = data[begin:end] * draw(st.integers(1, 60))
    return bytes(data)


def search(strategy: st.SearchStrategy[bytes], check: Callable[[bytes], object]) -> None:
    """Checks drawn contents: a few that are the same in every run, or as many as there is time for."""
    deadline = time.monotonic() + SECONDS

    @settings(
        max_examples=10**9 if SECONDS else 25,
        derandomize=not SECONDS,
        phases=[Phase.generate] if SECONDS else [Phase.generate, Phase.shrink],
        database=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )
    @given(strategy)
    def one(data: bytes) -> None:
        if SECONDS and time.monotonic() > deadline:
            pytest.skip("the time is over, and nothing was found")
        check(data)

    one()


@pytest.mark.timeout(300 + 2 * SECONDS)
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_a_damaged_file_is_read_or_refused(target: Target, tmp_path: Path) -> None:
    path = tmp_path / f"x{target.name if target.name.startswith('.') else '.mcap'}"

    def check(data: bytes) -> None:
        path.write_bytes(data)
        try:
            target.read(path)
        except target.errors as error:
            said = str(error)
            assert said == printable(said) != ""

    search(damaged(target.valid), check)
