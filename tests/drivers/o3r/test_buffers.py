"""Buffers of the ifm O3R are read in SI units; malformed ones raise, without reading beyond the end."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib import pose
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.o3r.buffers import O3rBuffers, exposure
from drivers.o3r.chunks import ChunkError, ChunkType, messages
from tests.drivers.o3r import pcic_messages


def read_buffers(folder: Path, content: bytes) -> O3rBuffers:
    path = folder / "buffer.data"
    path.write_bytes(content)
    return O3rBuffers(path)


def test_a_message_becomes_four_images_of_one_exposure(tmp_path: Path) -> None:
    read = read_buffers(tmp_path, pcic_messages.exposure(7) + pcic_messages.exposure(8))
    frames = list(read.frames())
    assert read.total == len(frames) == 8
    assert [(frame.stream, frame.seq) for frame in frames[:4]] == [
        ("depth", 7),
        ("deviation", 7),
        ("amplitude", 7),
        ("confidence", 7),
    ]
    depth, deviation, amplitude, confidence = frames[:4]
    assert {frame.t_host_ns for frame in frames[:4]} == {1_700_000_007_000_000_500}
    assert (depth.geometry, depth.unit, deviation.unit) == (Geometry.RADIAL, "m", "m")
    assert depth.si()[5, 7] == pytest.approx(507 * 0.00025)
    assert np.isnan(depth.si()[0, 0])
    assert deviation.si()[5, 7] == pytest.approx(10 * 0.00025)
    assert amplitude.si()[5, 7] == pytest.approx(5069**2 * 0.5)
    assert np.isnan(amplitude.si()[0, 0])
    assert confidence.data[5, 7] == 16
    assert depth.exposure_s == pytest.approx(1e-3)
    assert depth.temperature_c == 41.5


def test_the_camera_is_opencvs_with_pixels_counted_from_their_centres(tmp_path: Path) -> None:
    camera = read_buffers(tmp_path, pcic_messages.exposure()).cameras["depth"]
    fx, fy, mx, my, _, *distortion = pcic_messages.LENS
    point = np.array([0.2, -0.1, 0.8])
    matrix = np.array([[fx, 0, mx], [0, fy, my], [0, 0, 1]])
    corner, _ = cv2.projectPoints(point[None], np.zeros(3), np.zeros(3), matrix, np.array(distortion))
    np.testing.assert_allclose(camera.project(pose.transform(camera.T_rs, point)), corner.ravel() - 0.5, atol=1e-5)


def test_the_lens_of_a_wide_view_is_opencvs_fisheye(tmp_path: Path) -> None:
    lens = (9.0, 8.0, 4.5, 3.25, 0.0, 0.05, -0.02, 0.004, -0.001, 1.4)
    chunks = (
        pcic_messages.chunk(100, bytes(96), 8, 6, 2),
        pcic_messages.chunk(420, pcic_messages.tof_info(3, lens), 8, 6, 0),
    )
    camera = read_buffers(tmp_path, pcic_messages.message(*chunks)).cameras["depth"]
    point = np.array([0.7, -0.4, 0.5])
    matrix = np.array([[9.0, 0, 4.5], [0, 8, 3.25], [0, 0, 1]])
    corner, _ = cv2.fisheye.projectPoints(point[None, None], np.zeros(3), np.zeros(3), matrix, np.array(lens[5:9]))
    np.testing.assert_allclose(camera.project(pose.transform(camera.T_rs, point)), corner.ravel() - 0.5, atol=1e-5)


def test_the_pose_turns_about_z_then_y_then_x(tmp_path: Path) -> None:
    T_rs = read_buffers(tmp_path, pcic_messages.exposure()).cameras["depth"].T_rs
    about_x, about_y, about_z = (cv2.Rodrigues(np.eye(3)[k] * angle)[0] for k, angle in enumerate((0.1, 0.2, 0.3)))
    np.testing.assert_allclose(T_rs[:3, :3], about_x @ about_y @ about_z, atol=1e-6)
    np.testing.assert_allclose(T_rs[:3, 3], (1, 2, 3))


def test_network_messages_and_older_versions_are_read(tmp_path: Path) -> None:
    old = pcic_messages.message(
        pcic_messages.chunk(100, bytes(96), 8, 6, 2, version=1),
        pcic_messages.chunk(420, pcic_messages.tof_info(newer=False), 8, 6, 0, version=1),
        on_the_wire=True,
    )
    (depth,) = read_buffers(tmp_path, old).frames()
    assert depth.t_host_ns == 123_456_000
    assert np.isnan(depth.temperature_c)
    assert np.all(np.isnan(depth.si()))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "there is no chunk at all"),
        (b"PNG", "byte 0: a message begins with four digits"),
        (pcic_messages.exposure()[:-6], "cut off"),
        (pcic_messages.exposure()[:100], "does not fit into"),
        (pcic_messages.message(pcic_messages.chunk(100, bytes(96), 8, 6, 2)), "no chunk TOF_INFO"),
        (pcic_messages.message(pcic_messages.chunk(420, pcic_messages.tof_info(), 8, 6, 0)), "no chunk DISTANCE"),
        (
            pcic_messages.message(
                pcic_messages.chunk(100, bytes(96), 8, 6, 2),
                pcic_messages.chunk(420, pcic_messages.tof_info(2), 8, 6, 0),
            ),
            "lens model 2 with skew 0 is not supported",
        ),
        (
            pcic_messages.message(
                pcic_messages.chunk(100, bytes(96), 8, 6, 2), pcic_messages.chunk(420, bytes(200), 8, 6, 0)
            ),
            "TOF_INFO needs 312 bytes, has 200",
        ),
    ],
)
def test_other_files_are_rejected_with_their_name(tmp_path: Path, content: bytes, complaint: str) -> None:
    with pytest.raises(ForeignRecordingError, match=complaint) as error:
        read_buffers(tmp_path, content)
    assert "buffer.data" in str(error.value)


def test_an_image_with_too_few_bytes_raises_when_read(tmp_path: Path) -> None:
    content = pcic_messages.message(
        pcic_messages.chunk(100, bytes(94), 8, 6, 2), pcic_messages.chunk(420, pcic_messages.tof_info(), 8, 6, 0)
    )
    with pytest.raises(ForeignRecordingError, match="needs 96 bytes"):
        list(read_buffers(tmp_path, content).frames())


def parsed(content: bytes) -> list[Frame]:
    return [
        frame
        for chunks in messages(content)
        if ChunkType.DISTANCE in chunks and ChunkType.TOF_INFO in chunks
        for frame in exposure(chunks).frames("")
    ]


@given(st.binary(max_size=200), st.booleans())
def test_arbitrary_bytes_are_read_or_rejected(content: bytes, begins: bool) -> None:
    try:
        frames = parsed(b"0000star" * begins + content)
    except ChunkError:
        return
    assert all(frame.data.size for frame in frames)


@given(st.lists(st.tuples(st.integers(0, 1400), st.integers(0, 255)), max_size=6), st.integers(0, 1400))
def test_a_corrupt_message_is_read_or_rejected(changes: list[tuple[int, int]], length: int) -> None:
    content = bytearray(pcic_messages.exposure())
    for position, value in changes:
        content[position % len(content)] = value
    try:
        frames = parsed(bytes(content[: length or None]))
    except ChunkError:
        return
    assert all(frame.data.size and frame.si().shape == frame.data.shape for frame in frames)


def test_a_real_buffer_has_the_expected_depth(data_set: Callable[[str], Path]) -> None:
    path = data_set("tof_ifm_o3r/O3RBuffer.data")
    read = O3rBuffers(path)
    frames = {frame.kind: frame for frame in read.frames()}
    distance, deviation = frames[Kind.DEPTH].si(), frames[Kind.DEVIATION].si()
    valid = np.isfinite(distance)
    assert valid.sum() == 9962
    assert (np.nanmin(distance) > 0.19, np.nanmax(distance) < 1.98) == (True, True)
    assert 0.0002 < np.median(deviation[valid]) < 0.002
    # The camera's own flag for a pixel without a distance is the lowest bit of its confidence.
    np.testing.assert_array_equal(frames[Kind.CONFIDENCE].data.view(np.uint8) % 2 == 0, valid)
    assert read.cameras["depth"].rays().shape == (172, 224, 3)
