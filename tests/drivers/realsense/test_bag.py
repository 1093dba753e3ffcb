"""Bags of librealsense: synthetic files, written after the format description, are read back in SI units."""

import contextlib
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.frame import Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.encoding.parsing import CodecError
from drivers.realsense.bag import RealsenseBag, pixels
from drivers.realsense.streams import StreamError

DEPTH = np.arange(48, dtype=np.uint16).reshape(6, 8)
COLOR = np.arange(144, dtype=np.uint8).reshape(6, 8, 3)
#: A turn of 2 acos(0.8) about y, and where the depth camera's origin is in the colour camera.
TURN, TRANSLATION = (0.0, 0.6, 0.0, 0.8), (0.015, 0.001, 0.002)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Two exposures of depth and one of colour, like a D435's."""
    return write(tmp_path / "d435.bag")


class Bag:
    """Writes the messages of a camera into a bag."""

    def __init__(self, writer: Any, store: Any) -> None:
        self._writer = writer
        self._store = store
        self._connections: dict[str, Any] = {}

    def put(self, topic: str, message: Any, time_ns: int = 1) -> None:
        name = type(message).__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, name, typestore=self._store)
        self._writer.write(self._connections[topic], time_ns, self._store.serialize_ros1(message, name))

    def make(self, name: str, **values: Any) -> Any:
        return self._store.types[name](**values)

    def header(self, seq: int, time_ns: int) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return self.make("std_msgs/msg/Header", seq=seq, stamp=stamp, frame_id="0")

    def image(self, seq: int, encoding: str, data: np.ndarray) -> Any:
        h, w, flat = data.shape[0], data.shape[1], data.view(np.uint8).ravel()
        step = flat.size // h
        values = {"height": h, "width": w, "encoding": encoding, "is_bigendian": 0, "step": step, "data": flat}
        return self.make("sensor_msgs/msg/Image", header=self.header(seq, 360 * 10**9 + seq * 10**8), **values)

    def info(self, model: str) -> Any:
        region = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(0, 0),
            height=6,
            width=8,
            distortion_model=model,
            D=np.array([0.1, -0.02, 0.001, 0.002, 0.0]),
            K=np.array([9.0, 0, 4, 0, 8.0, 3, 0, 0, 1]),
            R=np.zeros(9),
            P=np.zeros(12),
            binning_x=0,
            binning_y=0,
            roi=self.make("sensor_msgs/msg/RegionOfInterest", **region),
        )

    def pose(self, turn: Iterable[float], translation: Iterable[float]) -> Any:
        rotation = self.make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, turn))))
        offset = self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, translation))))
        return self.make("geometry_msgs/msg/Transform", rotation=rotation, translation=offset)


def write(path: Path, model: str = "Brown Conrady", units: float = 0.0001, with_info: bool = True) -> Path:
    pytest.importorskip("rosbags", reason="needs rosbags: make all")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    with Writer(path) as writer:
        bag = Bag(writer, get_typestore(Stores.ROS1_NOETIC))
        bag.put("/device_0/sensor_0/option/Depth Units/value", bag.make("std_msgs/msg/Float32", data=units))
        for stream, turn, translation in (
            ("sensor_0/Depth_0", (0, 0, 0, 1), (0, 0, 0)),
            ("sensor_1/Color_0", TURN, TRANSLATION),
        ):
            if with_info:
                bag.put(f"/device_0/{stream}/info/camera_info", bag.info(model))
            bag.put(f"/device_0/{stream}/tf/0", bag.pose(turn, translation))
        for seq, stream, encoding, data, exposure in (
            (7, "sensor_0/Depth_0", "mono16", DEPTH, "6452"),
            (3, "sensor_1/Color_0", "rgb8", COLOR, "166"),
            (8, "sensor_0/Depth_0", "mono16", DEPTH + np.uint16(1), "nan"),
        ):
            time_ns = seq * 10**8
            bag.put(f"/device_0/{stream}/image/data", bag.image(seq, encoding, data), time_ns)
            about = {"timestamp_domain": "Hardware Clock", "system_time": str(1.5e12 + seq * 100 + 17 * (seq == 8))}
            for key, value in (about | {"Actual Exposure": exposure, "Gain Level": "16"}).items():
                said = bag.make("diagnostic_msgs/msg/KeyValue", key=key, value=value)
                bag.put(f"/device_0/{stream}/image/metadata", said, time_ns)
        bag.put("/device_1/sensor_0/Depth_0/image/data", bag.image(1, "mono16", DEPTH), 5)
    return path


def test_images_have_metadata_and_device_time(bag: Path) -> None:
    read = RealsenseBag(bag)
    frames = {(frame.sensor, frame.seq): frame for frame in read.frames()}
    assert read.total == len(frames) == 3
    first, second, color = frames["depth", 7], frames["depth", 8], frames["color", 3]
    np.testing.assert_array_equal(second.data, DEPTH + 1)
    np.testing.assert_array_equal(color.data, COLOR)
    assert first.si()[5, 7] == pytest.approx(47 * 0.0001)
    assert (first.kind, first.geometry, first.invalid) == (Kind.DEPTH, Geometry.Z, 0.0)
    # The host saw the last one 17 ms late; the device's clock knows better.
    assert second.t_host_ns - first.t_host_ns == 100_000_000
    assert first.t_host_ns - color.t_host_ns == 400_000_000
    assert color.t_host_ns == 1_500_000_000_300_000_000
    assert first.t_device_ticks == 360_700_000_000
    assert (first.exposure_s, first.gain) == (pytest.approx(6452e-6), 16)
    assert color.exposure_s == pytest.approx(166e-4)
    assert np.isnan(second.exposure_s)


def test_the_extrinsics_of_the_colour_camera(bag: Path) -> None:
    camera = RealsenseBag(bag).cameras["color"]
    point_d = np.array([0.1, -0.05, 0.8])
    angle = 2 * np.arctan2(0.6, 0.8)
    matrix, distortion = np.array([[9.0, 0, 4], [0, 8, 3], [0, 0, 1]]), np.array([0.1, -0.02, 0.001, 0.002, 0])
    expected, _ = cv2.projectPoints(point_d[None], np.array([0, angle, 0]), np.array(TRANSLATION), matrix, distortion)
    np.testing.assert_allclose(camera.project(point_d), expected.ravel(), atol=1e-9)


def test_other_files_are_rejected_with_their_name(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="needs rosbags: make all")
    (tmp_path / "text.bag").write_bytes(b"no bag")
    with pytest.raises(ForeignRecordingError, match=r"text.bag: this is no ROS 1 bag"):
        RealsenseBag(tmp_path / "text.bag")
    (tmp_path / "film.mkv").write_bytes(b"\x1aE\xdf\xa3\xa3B\x86\x81" * 1000 + b"\n")
    with pytest.raises(ForeignRecordingError, match=r"film.mkv: this is no ROS 1 bag") as caught:
        RealsenseBag(tmp_path / "film.mkv")
    assert len(str(caught.value)) < 300
    with pytest.raises(ForeignRecordingError, match=r"nothing.bag: cannot be read"):
        RealsenseBag(tmp_path / "nothing.bag")
    with pytest.raises(ForeignRecordingError, match="has no camera_info"):
        RealsenseBag(write(tmp_path / "bare.bag", with_info=False))
    with pytest.raises(ForeignRecordingError, match="distortion 'ftheta' is none of brown conrady"):
        RealsenseBag(write(tmp_path / "fisheye.bag", model="Ftheta"))
    with pytest.raises(ForeignRecordingError, match=r"a depth unit of 0.0 m is none"):
        RealsenseBag(write(tmp_path / "unit.bag", units=0.0))


def test_a_bag_of_a_ros_driver_is_told_with_the_way_out(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="needs rosbags: make all")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    with Writer(tmp_path / "take.bag") as writer:
        bag = Bag(writer, get_typestore(Stores.ROS1_NOETIC))
        bag.put("/camera/depth/image_raw", bag.image(0, "16UC1", DEPTH))
    with pytest.raises(
        ForeignRecordingError, match=r"'/camera/depth/image_raw'\]; .* --src take.bag --dst take` makes"
    ):
        RealsenseBag(tmp_path / "take.bag")


def test_a_corrupt_bag_is_read_or_rejected(bag: Path, tmp_path: Path) -> None:
    content, rng = bag.read_bytes(), np.random.default_rng(5)
    damaged = tmp_path / "damaged.bag"
    refused = 0
    for _ in range(60):
        changed = bytearray(content[: int(rng.integers(len(content) // 2, len(content) + 1))])
        for position in rng.integers(len(changed), size=3):
            changed[position] = int(rng.integers(256))
        damaged.write_bytes(changed)
        try:
            list(RealsenseBag(damaged).frames())
        except ForeignRecordingError:
            refused += 1
    assert refused > 0


@given(
    st.sampled_from([Kind.DEPTH, Kind.IR, Kind.CONFIDENCE, Kind.COLOR]),
    st.sampled_from(["mono8", "mono16", "rgb8", "bgr8", "yuyv", ""]),
    st.integers(0, 20),
    st.integers(0, 20),
    st.integers(0, 80),
    st.binary(max_size=400),
)
def test_arbitrary_image_messages_are_an_image_or_rejected(
    kind: Kind, encoding: str, width: int, height: int, step: int, data: bytes
) -> None:
    message = SimpleNamespace(
        encoding=encoding, is_bigendian=0, width=width, height=height, step=step, data=np.frombuffer(data, np.uint8)
    )
    with contextlib.suppress(StreamError, CodecError):
        _, image = pixels(kind, message)
        assert image.shape[:2] == (height, width)


def test_depth_and_colour_of_a_real_bag_are_registered(data_set: Callable[[str], Path]) -> None:
    """The room's corner, 1.9 m away, is at column 326 of the depth image and at column 330 of the colours."""
    pytest.importorskip("rosbags", reason="needs rosbags: make all")
    path = data_set("realsense_bag/single_depth_color_640x480.bag")
    read = RealsenseBag(path)
    frames = [frame for frame in read.frames() if frame.kind == Kind.DEPTH]
    assert [frame.seq for frame in frames] == [169, 170]
    depth = frames[0].si()
    assert np.isfinite(depth).mean() == pytest.approx(0.933, abs=0.001)
    camera = read.cameras["depth"]
    corner_r = camera.unproject(depth / camera.rays()[..., 2])[60, 326]
    assert abs(read.cameras["color"].project(corner_r)[0] - 330) < 5
