"""Recordings of BundleFusion and ScanNet: files written after `sensorData.h` are read back in SI units."""

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from drivers.contract.frame import Frame, Geometry, Kind
from drivers.opening import open_recording
from drivers.sens.recording import SensRecording
from tests.drivers.sens import sens_file
from tests.drivers.sens.sens_file import DEPTH_TO_COLOR, JPEG, PNG, RAW, ZLIB, SensFile, Shot, shots

STAMPED = shots(4, depth_us=1_500_000_000_000_000, color_us=1_500_000_000_005_000, period_us=33_333)


def recorded(path: Path, file: SensFile, **options: Any) -> SensRecording:
    path.write_bytes(file.content())
    return SensRecording(path, **options)


def seen(recording: SensRecording) -> list[tuple[str, int, int]]:
    return [(frame.sensor, frame.seq, frame.t_host_ns) for frame in recording.frames()]


def of(recording: SensRecording, sensor: str) -> list[Frame]:
    return [frame for frame in recording.frames() if frame.sensor == sensor]


def test_depth_is_in_metres_along_z_and_colours_are_in_order(tmp_path: Path) -> None:
    (tmp_path / "x.sens").write_bytes(SensFile(STAMPED).content())
    recording = open_recording("sens", tmp_path / "x.sens")
    assert recording.total == 8
    depth, color = list(recording.frames())[2:4]
    assert (depth.sensor, depth.stream, depth.kind, depth.geometry) == ("depth", "depth", Kind.DEPTH, Geometry.Z)
    assert np.isnan(depth.si()[0, 0])
    np.testing.assert_allclose(depth.si().ravel()[1:], (1001 + np.arange(1, 48)) / 1000, rtol=1e-6)
    assert (color.sensor, color.kind, color.encoding) == ("color", Kind.COLOR, "bgr8")
    assert color.data[3, 4].tolist() == [11, 100, 200]
    assert (depth.calib_id, color.calib_id) == tuple(recording.cameras[name].calib_id for name in ("depth", "color"))


def test_time_stamps_are_those_of_the_file(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "x.sens", SensFile(STAMPED[:2]))
    assert seen(recording) == [
        ("depth", 0, 1_500_000_000_000_000_000),
        ("color", 0, 1_500_000_000_005_000_000),
        ("depth", 1, 1_500_000_000_033_333_000),
        ("color", 1, 1_500_000_000_038_333_000),
    ]
    depth = next(recording.frames())
    assert (depth.t_device_ticks, depth.tick_hz, depth.clock_domain) == (1_500_000_000_000_000, 1e6, "sens")
    assert recording.time_problem == ""


def test_images_of_two_clocks_are_in_order_of_time(tmp_path: Path) -> None:
    late = shots(3, depth_us=0, color_us=150, period_us=100)
    assert [frame[:2] for frame in seen(recorded(tmp_path / "x.sens", SensFile(late)))] == [
        ("depth", 0),
        ("depth", 1),
        ("color", 0),
        ("depth", 2),
        ("color", 1),
        ("color", 2),
    ]


def test_without_time_stamps_there_is_a_rate(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "x.sens", SensFile(shots(2)))
    reason = "time stamps do not increase (depth of frame 1 is of 0 µs after 0 µs)"
    assert recording.time_problem == f"{reason}: 30 frames per second are assumed"
    assert seen(recording) == [("depth", 0, 0), ("color", 0, 0), ("depth", 1, 33_333_333), ("color", 1, 33_333_333)]
    assert {(frame.t_device_ticks, frame.tick_hz) for frame in recording.frames()} == {(0, 0.0)}


def test_a_rate_takes_the_place_of_time_stamps(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "x.sens", SensFile(STAMPED), rate_hz=10.0)
    assert {frame.t_host_ns for frame in recording.frames()} == {0, 100_000_000, 200_000_000, 300_000_000}
    assert recording.time_problem == ""


@pytest.mark.parametrize("wrong", [[0, 0, 77, 0], [5, 4, 3, 2], [0, 1, 2, 2**63]])
def test_random_time_stamps_are_not_believed(tmp_path: Path, wrong: list[int]) -> None:
    taken = shots(4)
    for shot, time_us in zip(taken, wrong):
        shot.depth_us = shot.color_us = time_us
    recording = recorded(tmp_path / "x.sens", SensFile(taken))
    assert "30 frames per second are assumed" in recording.time_problem
    assert len({frame.t_host_ns for frame in recording.frames()}) == 4


def test_colours_without_time_stamps_have_those_of_depth(tmp_path: Path) -> None:
    taken = shots(3, depth_us=1000, period_us=100)
    for shot in taken:
        shot.color_us = 0
    recording = recorded(tmp_path / "x.sens", SensFile(taken))
    assert recording.time_problem.endswith("(color of frame 1 is of 0 µs after 0 µs): those of depth are taken")
    assert [time for _, _, time in seen(recording)] == [1_000_000] * 2 + [1_100_000] * 2 + [1_200_000] * 2


def test_cameras_are_where_the_extrinsics_say(tmp_path: Path) -> None:
    """A point of the base frame, which is that of colour, is projected by the matrices of the file."""
    cameras = recorded(tmp_path / "x.sens", SensFile(STAMPED)).cameras
    point_color = np.array([0.1, -0.05, 0.8])
    point_depth = np.linalg.solve(DEPTH_TO_COLOR, [*point_color, 1])[:3]
    np.testing.assert_array_equal(cameras["depth"].T_rs, np.eye(4))
    for name, point, (fx, fy, mx, my) in (
        ("color", point_color, (9, 10, 4.5, 3.5)),
        ("depth", point_depth, (7, 8, 3.5, 2.5)),
    ):
        expected = fx * point[0] / point[2] + mx, fy * point[1] / point[2] + my
        np.testing.assert_allclose(cameras[name].project(point_depth), expected, atol=1e-5)
        assert cameras[name].lens.is_pinhole
    assert (cameras["color"].width, cameras["color"].height) == (10, 8)
    assert (cameras["depth"].width, cameras["depth"].height) == (8, 6)


def test_a_part_of_the_frames_keeps_its_numbers(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "x.sens", SensFile(STAMPED), wanted={1, 3}.__contains__)
    assert [frame[:2] for frame in seen(recording)] == [("depth", 1), ("color", 1), ("depth", 3), ("color", 3)]
    assert recording.total == 4


def test_missing_images_are_gaps_and_colours_may_be_missing_at_all(tmp_path: Path) -> None:
    taken = shots(3, depth_us=10, color_us=12, period_us=5)
    taken[1].depth = taken[2].color = None
    recording = recorded(tmp_path / "x.sens", SensFile(taken))
    assert [frame[:2] for frame in seen(recording)] == [("depth", 0), ("color", 0), ("color", 1), ("depth", 2)]
    for shot in taken:
        shot.color, shot.color_us = None, 0
    blind = SensFile(taken, color_size=(0, 0), color_compression=-1, intrinsic_color=np.eye(4))
    recording = recorded(tmp_path / "y.sens", blind)
    assert (set(recording.cameras), recording.total, recording.time_problem) == ({"depth"}, 2, "")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(st.data())
def test_a_round_trip_changes_no_pixel(tmp_path: Path, data: st.DataObject) -> None:
    """Any size, compression without loss, unit and number of frames."""
    sizes = [data.draw(st.tuples(st.integers(1, 12), st.integers(1, 12)), label) for label in ("depth", "color")]
    (depth_width, depth_height), (color_width, color_height) = sizes
    depths = st.none() | arrays.arrays(np.uint16, (depth_height, depth_width))
    colors = st.none() | arrays.arrays(np.uint8, (color_height, color_width, 3))
    taken = data.draw(st.lists(st.builds(Shot, depths, colors), min_size=1, max_size=4), "shots")
    taken[0].depth = np.ones((depth_height, depth_width), np.uint16)
    file = SensFile(
        taken,
        name=data.draw(st.binary(max_size=20), "name"),
        color_compression=data.draw(st.sampled_from([RAW, PNG]), "color compression"),
        depth_compression=data.draw(st.sampled_from([RAW, ZLIB]), "depth compression"),
        depth_size=sizes[0],
        color_size=sizes[1],
        depth_shift=data.draw(st.sampled_from([1.0, 1000.0, 5000.0]), "depth shift"),
        inertial=data.draw(st.integers(0, 2), "inertial"),
    )
    recording = recorded(tmp_path / "x.sens", file)
    for name, order in (("depth", {}), ("color", {"bgr8": -1})):
        expected = {k: image for k, shot in enumerate(taken) if (image := getattr(shot, name)) is not None}
        frames = {frame.seq: frame for frame in of(recording, name)}
        assert frames.keys() == expected.keys()
        for k, frame in frames.items():
            np.testing.assert_array_equal(frame.data[..., :: order.get(frame.encoding, 1)], expected[k])
    assert {frame.scale for frame in of(recording, "depth")} == {1 / file.depth_shift}


def test_jpeg_is_as_it_was_but_for_its_loss(tmp_path: Path) -> None:
    frames = of(recorded(tmp_path / "x.sens", SensFile(STAMPED, color_compression=JPEG)), "color")
    for k, frame in enumerate(frames):
        assert np.all(np.abs(frame.data[..., ::-1].astype(int) - [200, 100, 10 + k]) < 6)


def test_memory_does_not_grow_with_the_file(tmp_path: Path) -> None:
    """40 MB of raw images, of which one or two are in memory."""
    depth, color = np.full((240, 320), 900, np.uint16), np.zeros((240, 320, 3), np.uint8)
    file = SensFile([], color_size=(320, 240), depth_size=(320, 240), color_compression=RAW, depth_compression=RAW)
    file.count = 100
    one = sens_file.frame(Shot(depth, color), color.tobytes(), depth.tobytes())
    path = tmp_path / "x.sens"
    with path.open("wb") as stream:
        stream.write(file.header())
        for _ in range(file.count):
            stream.write(one)
    del one
    tracemalloc.start()
    try:
        assert sum(1 for _ in SensRecording(path).frames()) == 200
        assert tracemalloc.get_traced_memory()[1] < 3_000_000
    finally:
        tracemalloc.stop()
