"""Bags of ROS 2 as rosbags writes them, in both kinds of files, are read back in SI units."""

import contextlib
import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from calib import pose
from calib.lenses.fisheye import KannalaBrandt
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.opening import open_recording
from drivers.ros2.bag import Ros2Bag
from drivers.ros2.images import ImageError, decode
from tests.drivers.ros2.take import LENS, STAMP_NS, Take

DEPTH = np.arange(48, dtype=np.uint16).reshape(6, 8)
COLOR = np.random.default_rng(2).integers(256, size=(6, 8, 3), dtype=np.uint8)
#: A turn of 2 acos(0.8) about y, and where the colour camera is.
TURN, TRANSLATION = (0.0, 0.6, 0.0, 0.8), (0.015, 0.001, 0.002)
D, C = "/camera/depth", "/camera/color"


def write(path: Path, storage: str = "MCAP") -> Path:
    """Two exposures of depth, rectified, and one of colour; both cameras below one link."""
    with Take(path, storage) as take:
        take.info(f"{D}/camera_info")
        take.info(f"{C}/camera_info")
        take.transform("link", "depth_optical", (0, 0, 0, 1), (0.1, 0, 0))
        take.transform("depth_optical", "color_optical", TURN, TRANSLATION)
        take.image(f"{D}/image_rect_raw", "depth_optical", "16UC1", DEPTH)
        take.image(f"{C}/image_raw", "color_optical", "rgb8", COLOR, STAMP_NS + 10_000_000)
        take.image(f"{D}/image_rect_raw", "depth_optical", "16UC1", DEPTH + np.uint16(1), STAMP_NS + 33_000_000)
    return path


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("whole", [True, False])
def test_images_and_cameras_of_both_kinds_of_files(tmp_path: Path, storage: str, whole: bool) -> None:
    folder = write(tmp_path / "take", storage)
    (file,) = (path for path in folder.iterdir() if path.suffix in {".mcap", ".db3"})
    read = open_recording("ros2", folder if whole else file)
    frames = list(read.frames())
    assert read.total == len(frames) == 3
    first, color, second = frames
    assert (first.sensor, first.stream, first.kind, first.geometry) == ("depth", "depth", Kind.DEPTH, Geometry.Z)
    np.testing.assert_array_equal(second.data, DEPTH + 1)
    assert first.si()[5, 7] == pytest.approx(0.047)
    assert np.isnan(first.si()[0, 0])
    assert (first.t_host_ns, first.t_arrival_ns) == (STAMP_NS, STAMP_NS + 5_000_000)
    assert [frame.seq for frame in frames] == [0, 0, 1]
    assert (color.sensor, color.encoding) == ("color", "rgb8")
    np.testing.assert_array_equal(color.data, COLOR)
    # Rectified images have the matrix P and no distortion, raw ones K and the lens.
    depth, raw = read.cameras["depth"], read.cameras["color"]
    assert (depth.fx, depth.fy, depth.cx, depth.cy, depth.lens.is_pinhole) == (7.0, 7.5, 4.5, 3.5, True)
    assert (first.undistorted, color.undistorted) == (True, False)
    assert (raw.fx, raw.fy, raw.cx, raw.cy) == (9.0, 8.0, 4.0, 3.0)
    np.testing.assert_array_equal(raw.lens.coefficients[:5], LENS)
    np.testing.assert_allclose(depth.T_rs, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(raw.T_rs, pose.from_quaternion(TURN, TRANSLATION), atol=1e-12)
    assert color.calib_id == raw.calib_id


def test_compressed_images_are_read_where_there_are_no_others(tmp_path: Path) -> None:
    png = cv2.imencode(".png", COLOR[..., ::-1])[1].tobytes()
    with Take(tmp_path / "take") as take:
        take.info(f"{D}/camera_info")
        take.info(f"{C}/camera_info", "equidistant", (0.1, 0.02, 0, 0))
        depth_png = cv2.imencode(".png", DEPTH)[1].tobytes()
        take.compressed(f"{D}/image_raw/compressedDepth", "one", "16UC1; compressedDepth png", b"\0" * 12 + depth_png)
        take.compressed(f"{C}/image_raw/compressed", "one", "rgb8; png compressed bgr8", png)
        take.info("/other/camera_info")
        take.image("/other/image_raw", "one", "bgr8", COLOR)
        take.compressed("/other/image_raw/compressed", "one", "bgr8; jpeg compressed bgr8", png)
    read = Ros2Bag(tmp_path / "take")
    frames = {frame.sensor: frame for frame in read.frames()}
    np.testing.assert_array_equal(frames["depth"].data, DEPTH)
    for name, encoding in (("color", COLOR[..., ::-1]), ("other", COLOR)):
        np.testing.assert_array_equal(frames[name].data, encoding)
    assert read.total == len(frames) == 3
    assert read.cameras["color"].lens.name == "fisheye"


def test_an_equidistant_lens_without_coefficients_bends(tmp_path: Path) -> None:
    with Take(tmp_path / "take") as take:
        take.info(f"{D}/camera_info", "equidistant", (0, 0, 0, 0))
        take.image(f"{D}/image_raw", "one", "16UC1", DEPTH)
    assert Ros2Bag(tmp_path / "take").cameras["depth"].lens == KannalaBrandt()


def test_an_image_that_opencv_refuses_is_left_out(tmp_path: Path) -> None:
    content = io.BytesIO()
    Image.new("L", (2**20 + 1, 1)).save(content, "png")
    with Take(tmp_path / "take") as take:
        for name in (D, C):
            take.info(f"{name}/camera_info")
        take.image(f"{D}/image_raw", "one", "16UC1", DEPTH)
        take.compressed(f"{C}/image_raw/compressed", "one", "rgb8; png compressed", content.getvalue())
    assert Ros2Bag(tmp_path / "take").cameras.keys() == {"depth"}


def test_depth_in_metres_has_no_return_where_it_is_not_finite(tmp_path: Path) -> None:
    metres = DEPTH.astype(np.float32) / 10
    metres[0, :3] = np.nan, np.inf, -np.inf
    with Take(tmp_path / "take") as take:
        take.info("/camera_info")
        take.image("/image", "one", "32FC1", metres)
    (frame,) = Ros2Bag(tmp_path / "take").frames()
    assert (frame.sensor, frame.unit) == ("camera0", "m")
    assert np.isnan(frame.si()[0, :3]).all()
    np.testing.assert_array_equal(frame.si()[1:], metres[1:])


def test_cameras_with_the_same_last_name_are_told_apart(tmp_path: Path) -> None:
    with Take(tmp_path / "take") as take:
        for name in ("left", "right"):
            take.info(f"/{name}/depth/camera_info")
            take.image(f"/{name}/depth/image_raw", "one", "16UC1", DEPTH)
            take.image(f"/{name}/depth/image_rect", "one", "16UC1", DEPTH)
    read = Ros2Bag(tmp_path / "take")
    assert read.cameras.keys() == {"left_depth", "right_depth"}
    assert read.total == 2
    assert all(frame.undistorted for frame in read.frames())


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_calls_of_services_in_a_bag_are_passed_over(tmp_path: Path, storage: str) -> None:
    with Take(tmp_path / "take", storage) as take:
        take.service("/add/_service_event")
        take.info(f"{D}/camera_info")
        take.image(f"{D}/image_rect_raw", "one", "16UC1", DEPTH)
    (frame,) = Ros2Bag(tmp_path / "take").frames()
    np.testing.assert_array_equal(frame.data, DEPTH)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("none", "cannot be read"),
        ("x.mcap", "this is no ROS 2 bag"),
        ("x.bag", "is a bag of ROS 1; `rosbags-convert --src x.bag --dst x` makes one of ROS 2"),
    ],
)
def test_other_files_are_rejected_with_their_name(tmp_path: Path, name: str, complaint: str) -> None:
    pytest.importorskip("rosbags", reason="needs rosbags: make all")
    if name != "none":
        (tmp_path / name).write_bytes(b"no MCAP")
    with pytest.raises(ForeignRecordingError, match=f"{name}: {complaint}"):
        Ros2Bag(tmp_path / name)


def test_a_damaged_bag_is_read_or_rejected(tmp_path: Path) -> None:
    (file,) = (path for path in write(tmp_path / "take").iterdir() if path.suffix == ".mcap")
    content, rng, refused = file.read_bytes(), np.random.default_rng(7), 0
    damaged = tmp_path / "damaged.mcap"
    for k in range(60):
        changed = bytearray(content[: int(rng.integers(len(content) // 2, len(content))) if k % 2 else None])
        for position in rng.integers(len(changed), size=4):
            changed[position] = int(rng.integers(256))
        damaged.write_bytes(changed)
        try:
            assert all(isinstance(frame, Frame) for frame in Ros2Bag(damaged).frames())
        except ForeignRecordingError:
            refused += 1
    assert refused > 0


def test_arbitrary_bytes_are_an_image_or_rejected() -> None:
    pytest.importorskip("rosbags", reason="needs rosbags: make all")
    from rosbags.typesys import Stores, get_typestore

    image: Any = get_typestore(Stores.ROS2_HUMBLE).types["sensor_msgs/msg/Image"]
    rng, decoded = np.random.default_rng(3), 0
    for _ in range(300):
        data = rng.integers(256, size=int(rng.integers(200)), dtype=np.uint8)
        height, width, step = (int(number) for number in rng.integers(0, (9, 9, 40)))
        encoding = str(rng.choice(["16UC1", "32FC1", "rgb8", "mono8", "yuv422", ""]))
        with contextlib.suppress(ImageError):
            _, _, pixels = decode(image(None, height, width, encoding, 0, step, data))
            assert pixels.shape[:2] == (height, width)
            decoded += 1
    assert decoded > 0
