"""Decoding of depthai's images: all formats give the same pixels, malformed messages raise."""

import contextlib
import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib import pose
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.oak import eeprom
from drivers.oak.eeprom import EepromError
from drivers.oak.images.picture import PictureError, camera, frame, pixels
from drivers.oak.images.recording import OakRecording
from drivers.oak.roles import ROLES
from drivers.simulated.address import parse
from tests.drivers.oak.pictures import DEPTH
from tests.sample.sample import DEVICE, EXPOSURES

SAMPLE = Path(__file__).parents[3] / "recordings" / "sample_oak"
TYPES = ["RAW16", "RAW8", "GRAY8", "BGR888i", "RGB888i", "BGR888p", "RGB888p", "NV12", "YUV420p", "RAW10", ""]
COLORS = np.random.default_rng(3).integers(256, size=(6, 8, 3), dtype=np.uint8)


def test_depth_is_in_millimetres_along_z_and_stamped_in_the_middle_of_its_exposure() -> None:
    made = frame(DEPTH, ROLES["tof_depth"], "id", ("median",))
    assert (made.sensor, made.stream, made.geometry, made.unit) == ("tof", "depth", Geometry.Z, "m")
    assert made.si()[0, 1] == pytest.approx((2 + 256 * 3) * 0.001)
    assert (made.t_host_ns, made.t_device_ticks) == (999_000_000, 699_000_000)
    assert (made.exposure_s, made.gain, made.temperature_c, made.filters) == (2e-3, 1.5, 40.0, ("median",))
    assert made.undistorted


@pytest.mark.parametrize("gap", [0, 5])
def test_row_padding_is_removed(gap: int) -> None:
    rows = np.concatenate([np.arange(48, dtype=np.uint8).reshape(6, 8), np.full((6, gap), 99, np.uint8)], axis=1)
    picture = replace(DEPTH, type="RAW8", stride=8 + gap, data=rows.ravel())
    np.testing.assert_array_equal(pixels(picture, Kind.IR)[1], np.arange(48).reshape(6, 8))


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("RGB888i", COLORS),
        ("BGR888i", COLORS[..., ::-1]),
        ("RGB888p", np.moveaxis(COLORS, -1, 0)),
        ("BGR888p", np.moveaxis(COLORS[..., ::-1], -1, 0)),
    ],
)
def test_all_colour_formats_decode_to_the_same_pixels(name: str, data: np.ndarray) -> None:
    stride = 24 if name.endswith("i") else 8
    picture = replace(DEPTH, type=name, stride=stride, data=np.ascontiguousarray(data).ravel())
    encoding, image = pixels(picture, Kind.COLOR)
    np.testing.assert_array_equal(image if encoding == "rgb8" else image[..., ::-1], COLORS)


def test_subsampled_chroma_is_decoded_as_by_opencv() -> None:
    color = np.full((6, 8, 3), (200, 100, 30), np.uint8)
    planes = cv2.cvtColor(color, cv2.COLOR_BGR2YUV_I420)
    for name in ("YUV420p", "NV12"):
        data = planes.copy()
        if name == "NV12":  # the same, with the two chroma planes interleaved
            data[6:] = np.stack([planes[6:].ravel()[:12], planes[6:].ravel()[12:]], axis=-1).reshape(3, 8)
        encoding, image = pixels(replace(DEPTH, type=name, stride=8, data=data.ravel()), Kind.COLOR)
        assert encoding == "bgr8"
        assert np.all(np.abs(image.astype(int) - color) < 4)


@given(
    st.sampled_from(TYPES), st.integers(-2, 20), st.integers(-2, 20), st.integers(-1, 70), st.binary(max_size=600),
    st.sampled_from([Kind.DEPTH, Kind.IR, Kind.COLOR]),
)  # fmt: skip
def test_arbitrary_bytes_are_an_image_or_rejected(
    name: str, width: int, height: int, stride: int, data: bytes, kind: Kind
) -> None:
    bytes_ = np.frombuffer(data, np.uint8)
    picture = replace(DEPTH, type=name, width=width, height=height, stride=stride, data=bytes_)
    with contextlib.suppress(PictureError):
        assert pixels(picture, kind)[1].shape[:2] == (height, width)


@given(
    st.lists(st.floats(width=32), max_size=16),
    st.lists(st.floats(width=32), min_size=9, max_size=9),
    st.sampled_from(["PERSPECTIVE", "FISHEYE", "CYLINDRICAL"]),
)
def test_arbitrary_parameters_are_a_camera_or_rejected(
    coefficients: list[float], matrix: list[float], model: str
) -> None:
    numbers = np.reshape(matrix, (3, 3))
    with contextlib.suppress(PictureError):
        made = camera(replace(DEPTH, coefficients=tuple(coefficients), matrix=numbers, model=model), pose.identity())
        assert made.fx > 0


CALIBRATION = (SAMPLE / "calibration.json").read_bytes()


@given(st.lists(st.tuples(st.integers(0, len(CALIBRATION) - 1), st.integers(0, 255)), min_size=1, max_size=8))
def test_a_corrupt_calibration_is_read_or_rejected(changes: list[tuple[int, int]]) -> None:
    content = bytearray(CALIBRATION)
    for position, value in changes:
        content[position] = value
    try:
        pose = eeprom.parse(bytes(content)).between(0, 2)
    except EepromError:
        return
    assert pose.shape == (4, 4)


def test_the_sample_recording_matches_the_simulation() -> None:
    read = OakRecording(SAMPLE)
    simulation = parse(DEVICE).build()
    seen = {frame.key: frame for frame in simulation.frames(EXPOSURES[3])}
    frames = {(made.key, made.seq): made for made in read.frames()}
    assert read.total == len(frames) == 18
    depth, color = frames[("tof", "depth"), EXPOSURES[3]], frames[("color", "color"), EXPOSURES[3]]
    z = seen["tof", "depth"].si() * simulation.heads["tof"].camera.rays()[..., 2]
    np.testing.assert_array_equal(np.isfinite(depth.si()), np.isfinite(z))
    assert np.nanmax(np.abs(depth.si() - z)) < 0.00051
    np.testing.assert_array_equal(color.data, seen["color", "color"].data)
    for name, head in simulation.heads.items():
        np.testing.assert_allclose(read.cameras[name].T_rs, head.camera.T_rs, atol=1e-6)
        assert read.cameras[name].fx == pytest.approx(head.camera.fx)


def test_a_corrupt_recording_is_read_or_rejected(tmp_path: Path) -> None:
    content, rng = (SAMPLE / "tof_depth.mcap").read_bytes(), np.random.default_rng(7)
    damaged, refused = tmp_path / "depth.mcap", 0
    for k in range(40):
        changed = bytearray(content[: int(rng.integers(len(content) // 2, len(content))) if k % 2 else None])
        for position in rng.integers(len(changed), size=4):
            changed[position] = int(rng.integers(256))
        damaged.write_bytes(changed)
        try:
            assert all(isinstance(made, Frame) for made in OakRecording(damaged).frames())
        except ForeignRecordingError:
            refused += 1
    assert refused > 0


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("depth.mcap", None, "depth.mcap: cannot be read"),
        ("depth.mcap", b"no MCAP", "depth.mcap: this is no recording of depthai"),
        ("video.mcap", b"", "its name says what it holds; it must be one of tof_depth.mcap"),
        ("", None, "there is no MCAP file in it"),
    ],
)
def test_other_files_are_rejected_with_their_name(
    tmp_path: Path, name: str, content: bytes | None, complaint: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ForeignRecordingError, match=complaint):
        OakRecording(tmp_path / name)


def test_without_a_calibration_only_one_camera_can_be_read(tmp_path: Path) -> None:
    for name in ("tof_depth", "tof_amplitude", "color"):
        (tmp_path / f"{name}.mcap").write_bytes((SAMPLE / f"{name}.mcap").read_bytes())
    with pytest.raises(ForeignRecordingError, match="nothing is known of where camera"):
        OakRecording(tmp_path)
    (tmp_path / "color.mcap").unlink()
    assert OakRecording(tmp_path).cameras.keys() == {"tof"}
    (tmp_path / "calibration.json").write_text(json.dumps({}))
    with pytest.raises(ForeignRecordingError, match="lacks 'cameraData'"):
        OakRecording(tmp_path)
