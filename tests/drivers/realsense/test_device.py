"""The RealSense driver on librealsense itself: its software device, and its recorder and player."""

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.controls import ControlKind
from drivers.contract.device import ControlError, DeviceError, DeviceState, SdkMissingError
from drivers.contract.frame import Geometry, Kind
from drivers.encoding.parsing import CodecError
from drivers.realsense import library, open_device
from drivers.realsense.controls import make
from drivers.realsense.device import RealsenseDevice
from drivers.realsense.opening import device_info, of_device
from drivers.realsense.picture import Picture, pixels
from drivers.realsense.streams import ROLES, StreamError
from tests.drivers.realsense.software_camera import SIZE, SoftwareCamera
from tests.drivers.recording_sink import RecordingSink

try:
    rs = library.load()
except SdkMissingError as error:
    pytest.skip(f"{error}, or  make all", allow_module_level=True)


@pytest.fixture
def device(camera: SoftwareCamera) -> Iterator[RealsenseDevice]:
    opened = of_device(rs, camera.device, device_info(rs, camera.device), time.monotonic_ns)
    yield opened
    opened.close()


def test_every_stream_arrives_in_si_units_on_the_cameras_clock(camera: SoftwareCamera, device: RealsenseDevice) -> None:
    receiver = RecordingSink()
    device.start(receiver)
    for number in range(5):
        camera.show(number, 2_000.0 + 33.333 * number)
        receiver.wait(lambda number=number: len(receiver.frames) == 4 * (number + 1))
    frames = {(frame.kind, frame.seq): frame for frame in receiver.frames}
    depth = frames[Kind.DEPTH, 3]
    assert depth.si()[5, 5] == pytest.approx(1003 * 0.0005)
    assert np.all(np.isnan(depth.si()[0]))
    assert (depth.geometry, depth.tick_hz, depth.t_device_ticks) == (Geometry.Z, 1e6, 2_099_999)
    assert depth.clock_domain == "realsense"
    assert {frames[kind, 3].sensor for kind in (Kind.IR, Kind.CONFIDENCE)} == {"depth"}
    assert frames[Kind.COLOR, 3].encoding == "rgb8"
    assert frames[Kind.COLOR, 3].data.shape == (48, 64, 3)
    assert device.info.serial == "0001"
    assert device.counters["frames"] == 20


@pytest.mark.parametrize(("separate", "color_s"), [(True, 8e-3), (False, 80e-6)])
def test_exposures_are_in_the_unit_of_the_sensor(separate: bool, color_s: float) -> None:
    """Colours from the depth sensor (D405) have its microseconds; a colour camera has units of 100 µs."""
    software = SoftwareCamera(separate=separate)
    device = of_device(rs, software.device, device_info(rs, software.device), time.monotonic_ns)
    receiver = RecordingSink()
    try:
        device.start(receiver)
        software.show(0, 1000.0)
        software.show(1, 1033.0)
        receiver.wait(lambda: len(receiver.frames) >= 8)
    finally:
        device.close()
    exposures = {frame.kind: frame.exposure_s for frame in receiver.frames if frame.seq == 1}
    assert exposures[Kind.DEPTH] == pytest.approx(80e-6)
    assert exposures[Kind.COLOR] == pytest.approx(color_s)
    assert [info.name for info in device.controls.infos if "exposure" in info.name] == ["exposure_s"]


def test_the_extrinsics_of_the_colour_camera(camera: SoftwareCamera, device: RealsenseDevice) -> None:
    point = [0.1, -0.05, 0.8]
    depth, color = camera.profiles["depth"], camera.profiles["color"]
    moved = rs.rs2_transform_point_to_point(depth.get_extrinsics_to(color), point)
    expected = rs.rs2_project_point_to_pixel(color.get_intrinsics(), moved)
    np.testing.assert_allclose(device.cameras["color"].project(np.array(point)), expected, atol=1e-3)


@pytest.mark.parametrize("model", ["modified_brown_conrady", "inverse_brown_conrady"])
def test_other_brown_conrady_models_are_near_enough_to_opencvs(model: str) -> None:
    camera = SoftwareCamera(model=model)
    device = of_device(rs, camera.device, device_info(rs, camera.device), time.monotonic_ns)
    intrinsics = camera.profiles["depth"].get_intrinsics()
    for point in ([0.1, -0.05, 0.8], [-0.3, 0.2, 0.8]):
        expected = rs.rs2_project_point_to_pixel(intrinsics, point)
        np.testing.assert_allclose(device.cameras["depth"].project(np.array(point)), expected, atol=0.01)


def test_an_unknown_lens_is_rejected() -> None:
    camera = SoftwareCamera(model="ftheta")
    with pytest.raises(DeviceError, match="distortion 'ftheta' is none of brown conrady"):
        of_device(rs, camera.device, device_info(rs, camera.device), time.monotonic_ns)


def test_host_times_follow_the_exposures_and_a_restart_is_a_new_epoch(
    camera: SoftwareCamera, device: RealsenseDevice
) -> None:
    receiver = RecordingSink()
    camera.run()
    for epoch in range(3):
        device.start(receiver)
        device.start(receiver)
        receiver.wait(lambda epoch=epoch: sum(frame.epoch == epoch for frame in receiver.frames) > 20)
        device.stop()
        assert device.state == DeviceState.CLOSED
        assert receiver.settle() == len(receiver.frames)
    assert all(abs(frame.t_arrival_ns - frame.t_host_ns) < 0.5e9 for frame in receiver.frames)
    device.close()
    device.close()
    with pytest.raises(DeviceError, match="closed"):
        device.start(receiver)


def test_recordings_of_librealsense_are_played(tmp_path: Path, camera: SoftwareCamera) -> None:
    path = tmp_path / "take.db3"
    recorder = rs.recorder(str(path), camera.device)
    sensors, queue = recorder.query_sensors(), rs.frame_queue(100)
    for sensor in sensors:
        sensor.open(sensor.get_stream_profiles())
        sensor.start(queue)
    for number in range(20):
        camera.show(number, 2_000.0 + 20 * number)
        time.sleep(0.02)
    for sensor in sensors:
        sensor.stop()
        sensor.close()
    recorder = sensors = sensor = None  # the file is complete when nothing holds the recorder
    device = open_device(f"realsense://?recording={path}", time.monotonic_ns)
    receiver = RecordingSink()
    try:
        assert device.info.model == "software camera"
        device.start(receiver)
        receiver.wait(lambda: receiver.states[-1] == (DeviceState.CLOSED, "the recording has ended"))
    finally:
        device.close()
    depths = [frame for frame in receiver.frames if frame.kind == Kind.DEPTH]
    assert [int(frame.data[5, 5]) for frame in depths] == [1000 + frame.seq for frame in depths]
    assert {frame.key for frame in receiver.frames} == {stream.key for stream in device.capabilities.streams}
    assert len(depths) >= 3  # it plays in real time, and a busy machine is late


class Options:
    """A sensor with the options of a D435, as the SDK has them."""

    def __init__(self) -> None:
        option = rs.option
        self.ranges = {option.exposure: (1, 165000, 1), option.gain: (16, 248, 1), option.laser_power: (0, 360, 30)}
        self.ranges |= {option.enable_auto_exposure: (0, 1, 1), option.inter_cam_sync_mode: (0, 2, 1)}
        self.values = dict.fromkeys(self.ranges, 0.0)

    def supports(self, key: Any) -> bool:
        return key in self.ranges

    def is_option_read_only(self, key: Any) -> bool:
        return False

    def get_option_range(self, key: Any) -> Any:
        low, high, step = self.ranges[key]
        return SimpleNamespace(min=low, max=high, step=step, default=low)

    def get_option(self, key: Any) -> float:
        return self.values[key]

    def set_option(self, key: Any, value: float) -> None:
        if key == rs.option.gain:
            raise RuntimeError("Failed to set control: device is busy")
        self.values[key] = value


def test_controls_are_in_si_units_and_in_the_cameras_steps() -> None:
    sensor = Options()
    controls = make(rs, "realsense://1", [(sensor, ROLES["depth", 0]), (sensor, ROLES["color", 0])])
    assert {info.name: info.kind for info in controls.infos}["sync_role"] == ControlKind.CHOICE
    controls.set("exposure_s", 0.0085)
    assert sensor.values[rs.option.exposure] == 8500
    controls.set("color.exposure_s", 0.0085)
    assert sensor.values[rs.option.exposure] == 85
    controls.set("laser_power", 0.55)
    assert sensor.values[rs.option.laser_power] == 210
    controls.set("sync_role", "slave")
    assert (sensor.values[rs.option.inter_cam_sync_mode], controls.get("sync_role")) == (2, "slave")
    controls.set("auto_exposure", True)
    assert controls.get("auto_exposure") is True
    with pytest.raises(ControlError, match=r"must be a number from 1e-06 to 0.165 s"):
        controls.set("exposure_s", 1.0)
    with pytest.raises(DeviceError, match="realsense://1: another program uses it"):
        controls.set("gain", 20.0)


@given(
    st.sampled_from(["z16", "y8", "y16", "raw8", "rgb8", "bgr8", "yuyv", ""]), st.integers(-2, 20), st.integers(-2, 20),
    st.integers(-1, 80), st.binary(max_size=600), st.sampled_from([Kind.DEPTH, Kind.IR, Kind.CONFIDENCE, Kind.COLOR]),
)  # fmt: skip
def test_arbitrary_bytes_are_an_image_or_rejected(
    name: str, width: int, height: int, stride: int, data: bytes, kind: Kind
) -> None:
    picture = Picture(name, width, height, stride, np.frombuffer(data, np.uint8), 0, 0.0, "", 0.001, 0.0, 0.0)
    with contextlib.suppress(StreamError, CodecError):
        assert pixels(picture, kind)[1].shape[:2] == (height, width)


def test_the_software_camera_has_the_size_it_says(device: RealsenseDevice) -> None:
    assert {(stream.width, stream.height) for stream in device.capabilities.streams} == {SIZE}
