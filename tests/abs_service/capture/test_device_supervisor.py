"""Devices are kept delivering, under the names of the rig, and what they are is announced."""

import dataclasses
import queue
import threading

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health as Message
from absmsg.v1.sensor_model_pb2 import Config, SensorModel
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool

from abs_service import config
from abs_service.bus import keys
from abs_service.bus.health import Health, Level
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture import device_supervisor, sensor_metadata, stall_detector
from abs_service.capture.device_supervisor import DeviceSupervisor
from abs_service.commands import capture as command
from abs_service.commands.capture import MetadataPublisher
from abs_service.commands.parts import rig_devices
from abs_service.commands.parts.rig_devices import HeadError, SettingError
from abs_service.wire.message_header import MESSAGES
from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls
from drivers.contract.device import AddressError, DeviceError, DeviceInfo, DeviceState
from drivers.contract.frame import Frame, Kind
from drivers.encoding.codec import CodecError
from drivers.encoding.sensor_model import decode_camera
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.waiting import eventually

CAMERA = Camera(4, 3, 5.0, 5.0, 1.5, 1.0, T_rs=pose.from_rotation_vector([0.1, 0.2, 0.3], [0.05, 0, 0.01]))


class FakeDevice:
    """Does what it is told."""

    capabilities = Capabilities((StreamInfo("head", "image", Kind.COLOR, "mono8", 4, 3, 30.0),))
    controls = Controls()
    gauges: dict[str, float] = {}  # noqa: RUF012
    state = DeviceState.CLOSED

    def __init__(self, heads=("head", "other"), start=lambda sink: None, serial="1"):
        self.info = DeviceInfo(f"fake://{serial}", "fake", serial)
        self.cameras = dict.fromkeys(heads, CAMERA)
        self.counters = {"frames": 1}
        self.start = start
        self.closed = threading.Event()

    def stop(self):
        pass

    def close(self):
        self.closed.set()


class Collector:
    """A sink that keeps everything."""

    def __init__(self):
        self.frames = queue.SimpleQueue()

    def on_frame(self, frame):
        self.frames.put(frame)

    def on_truth(self, truth):
        pass

    def on_state(self, state, reason):
        pass

    def on_warning(self, condition, message):
        pass


def frame(sensor="head", seq=0):
    return Frame(sensor, "image", Kind.COLOR, np.zeros((3, 4), np.uint8), "mono8", 1, 1, seq)


@pytest.fixture
def asked():
    """The addresses that supervisors have opened."""
    return []


@pytest.fixture
def keep(monkeypatch, asked):
    """Starts a supervisor on devices that are made one after the other; closed after the test."""
    monkeypatch.setattr(device_supervisor, "FIRST_BACKOFF_S", 0.1)
    supervisors = []

    def keep(*make, on_open=lambda device: None):
        makers = iter(make)
        collector, bus = Collector(), LoopbackBus()
        health = Health(bus, "capture", HeaderFactory("demo", WallClock()))

        def open_device(uri):
            asked.append(uri)
            return next(makers)()

        supervisor = DeviceSupervisor(
            "sim", "fake://", open_device, on_open, collector, {"head": "tof"}, health, WallClock().monotonic
        )
        supervisors.append(supervisor)
        supervisor.start()
        return supervisor, collector, lambda: health_now(health, bus)

    yield keep
    for supervisor in supervisors:
        supervisor.close(5)


def no_device():
    raise DeviceError("no such device; plug it in")


def failing(reason):
    def start(sink):
        sink.on_state(DeviceState.STREAMING, "")
        sink.on_frame(frame())
        sink.on_state(DeviceState.FAILED, reason)

    return lambda: FakeDevice(start=start)


def working():
    return FakeDevice(start=lambda sink: (sink.on_state(DeviceState.STREAMING, ""), sink.on_frame(frame())))


def test_a_failed_device_is_opened_again_in_a_later_epoch(keep):
    _, collector, health = keep(failing("unplugged"), working)
    first, second = collector.frames.get(timeout=5), collector.frames.get(timeout=5)
    assert (first.sensor, second.sensor) == ("tof", "tof")
    assert second.epoch > first.epoch
    assert eventually(lambda: health().level == Message.LEVEL_OK)
    assert health().counters["device.sim.reconnects"] == 1
    assert eventually(lambda: health().counters["device.sim.frames"] == 2), "both devices count one frame"
    assert eventually(lambda: health().labels["device.sim"] == "streaming")


def test_a_device_error_is_reported_until_the_device_can_be_opened(keep):
    _, collector, health = keep(no_device, working)
    assert eventually(lambda: health().level == Message.LEVEL_ERROR)
    assert health().message == "sim: no such device; plug it in; trying again in 0.2 s"
    assert collector.frames.get(timeout=5)
    assert eventually(lambda: health().level == Message.LEVEL_OK)


def test_an_address_that_no_device_can_have_is_refused(keep):
    def misspelt():
        raise AddressError("simulated://shet: there is no such scene")

    supervisor, collector, _ = keep(misspelt, working)
    assert eventually(lambda: isinstance(supervisor.fatal_error, AddressError))
    assert collector.frames.empty()


def test_a_mistake_of_a_driver_is_a_failure_like_any_other(keep, caplog):
    def broken():
        raise ZeroDivisionError("a mistake")

    _, collector, _ = keep(broken, working)
    assert collector.frames.get(timeout=5)
    assert "ZeroDivisionError" in caplog.text


def test_a_device_that_falls_silent_is_stalled_and_then_opened_again(keep, monkeypatch):
    monkeypatch.setattr(stall_detector, "STALL_NS", 200_000_000)
    monkeypatch.setattr(stall_detector, "REOPEN_NS", 600_000_000)
    _, collector, health = keep(working, working)
    first = collector.frames.get(timeout=5)
    assert eventually(lambda: health().labels["device.sim"] == "stalled")
    assert health().level == Message.LEVEL_WARNING
    assert "head/image delivers nothing for" in health().message
    assert collector.frames.get(timeout=5).epoch > first.epoch
    assert health().counters["device.sim.stalls"] >= 1


def test_only_the_same_serial_number_is_accepted_after_a_reconnect(keep, asked):
    def other():
        return FakeDevice(start=working().start, serial="2")

    _, collector, health = keep(failing("unplugged"), other, working)
    collector.frames.get(timeout=5)
    assert eventually(lambda: "is device 2 now; 1 is awaited" in health().message)
    assert collector.frames.get(timeout=5)
    assert asked == ["fake://", "fake://1", "fake://1"], "by its serial number, though the address has none"


def test_warnings_and_gauges_of_a_device_are_in_the_health(keep):
    device = working()
    device.gauges = {"temperature_c": 41.5}
    device.start = lambda sink: (
        sink.on_state(DeviceState.STREAMING, ""),
        sink.on_frame(frame()),
        sink.on_warning("usb speed", "USB 2 only; use a blue port"),
        sinks.append(sink),
    )
    sinks = []
    _, _, health = keep(lambda: device)
    assert eventually(lambda: health().level == Message.LEVEL_WARNING)
    assert health().message == "sim: USB 2 only; use a blue port"
    assert health().gauges["device.sim.temperature_c"] == 41.5
    sinks[0].on_warning("usb speed", "")
    assert eventually(lambda: health().level == Message.LEVEL_OK)


def test_a_control_is_set_at_every_opening_and_a_wrong_one_is_explained():
    held = {}
    info = ControlInfo("exposure_s", ControlKind.NUMBER, "s", 1e-5, 0.03)
    device = FakeDevice()
    device.controls = Controls([Control(info, lambda: 0.0, lambda value: held.update(exposure_s=value))])
    rig_devices.set_controls(device, {"exposure_s": 0.01}, "rig.toml: devices.cam.controls")
    assert held == {"exposure_s": 0.01}
    expected = r"^rig\.toml: devices\.cam\.controls\.exposure_s = 5: must be a number from 1e-05 to 0\.03 s$"
    with pytest.raises(SettingError, match=expected):
        rig_devices.set_controls(device, {"exposure_s": 5}, "rig.toml: devices.cam.controls")
    with pytest.raises(SettingError, match=r"controls\.gain: the device has no such control, it has: exposure_s"):
        rig_devices.set_controls(device, {"gain": 5}, "rig.toml: devices.cam.controls")


def test_a_device_that_does_not_answer_when_it_is_set_is_tried_again(keep):
    calls = []

    def on_open(device):
        calls.append(device)
        if len(calls) == 1:
            raise DeviceError("does not answer")

    supervisor, collector, _ = keep(working, working, on_open=on_open)
    assert collector.frames.get(timeout=5)
    assert supervisor.fatal_error is None


def test_frames_of_heads_that_are_not_configured_are_counted_and_dropped(keep):
    device = FakeDevice(start=lambda sink: [sink.on_frame(frame(sensor)) for sensor in ("other", "other", "head")])
    _, collector, health = keep(lambda: device)
    assert collector.frames.get(timeout=5).sensor == "tof"
    assert eventually(lambda: health().counters["device.sim.unwanted"] == 2)
    assert collector.frames.empty()


def test_a_device_at_its_end_is_not_opened_again(keep):
    device = FakeDevice(start=lambda sink: sink.on_state(DeviceState.CLOSED, "end of the recording"))
    supervisor, _, health = keep(lambda: device)
    assert eventually(lambda: supervisor.finished)
    assert device.closed.wait(5)
    assert health().level == Message.LEVEL_OK


def test_a_device_that_does_not_fit_is_refused_and_closed(keep):
    device = FakeDevice()

    def refuse(_):
        raise HeadError("no such head")

    supervisor, _, _ = keep(lambda: device, on_open=refuse)
    assert eventually(lambda: supervisor.fatal_error)
    assert device.closed.wait(5)


def test_a_device_that_opens_after_the_end_is_closed_and_not_announced(keep):
    asked_for, open_now, announced = threading.Event(), threading.Event(), []
    device = FakeDevice()

    def slow():
        asked_for.set()
        open_now.wait(5)
        return device

    supervisor, _, health = keep(slow, on_open=announced.append)
    assert asked_for.wait(5)
    supervisor.close(0.01)
    open_now.set()
    assert device.closed.wait(5)
    assert not announced
    assert supervisor.fatal_error is None
    assert health().level == Message.LEVEL_OK


def test_what_fails_after_the_end_is_no_error_of_the_rig(keep):
    asked_for, fail_now, device = threading.Event(), threading.Event(), FakeDevice()

    def announce(_):
        asked_for.set()
        fail_now.wait(5)
        raise RuntimeError("session closed")

    supervisor, _, _ = keep(lambda: device, on_open=announce)
    assert asked_for.wait(5)
    supervisor.close(0.01)
    fail_now.set()
    assert device.closed.wait(5)
    assert supervisor.fatal_error is None


RIG = """
version = 1
name = "demo"
devices.cam.uri = "fake:x"
[sensors.tof]
device = "cam"
head = "head"
noise = { type = "gaussian_polynomial", sigma = [[1e-2, 2e-3]] }
outlier_share = 0.1
[sensors.tof.camera]
T_rs = { translation = [0.1, 0.2, 0.3] }
[sensors.color]
device = "cam"
head = "other"
"""


@pytest.fixture
def metadata(tmp_path):
    bus = LoopbackBus()
    return bus, MetadataPublisher(bus, HeaderFactory("demo", WallClock()), config.loads(RIG, "rig.toml", tmp_path))


def test_what_the_sensors_are_is_announced_with_the_calibration_of_the_configuration(metadata):
    bus, metadata = metadata
    metadata.add_device("cam", FakeDevice())
    told = {sample.topic: sample.payload for sample in bus.query("**", 1)}
    assert set(told) == {"config", "tf", "tof/model", "tof/calibration", "color/model", "color/calibration"}
    model = SensorModel.FromString(told["tof/model"])
    assert (model.noise, model.fx, model.width) == ("gaussian_polynomial", 5.0, 4)
    assert list(model.noise_parameters["sigma"].values) == [1e-2, 2e-3]
    assert list(model.noise_parameters["outlier_share"].values) == [0.1]
    assert "range_m" not in model.noise_parameters
    assert np.reshape(model.T_rs, (4, 4))[:3, 3].tolist() == [0.1, 0.2, 0.3]
    assert SensorModel.FromString(told["color/model"]).calib_id == CAMERA.calib_id
    calibration = CameraCalibration.FromString(told["tof/calibration"])
    assert list(calibration.K) == [5, 0, 1.5, 0, 5, 1.0, 0, 0, 1]
    assert (calibration.frame_id, len(calibration.D), len(calibration.P)) == ("tof", 8, 12)
    assert "[sensors.tof]" in Config.FromString(told["config"]).toml
    tof, color = FrameTransforms.FromString(told["tf"]).transforms
    assert (tof.parent_frame_id, tof.child_frame_id, tof.rotation.w) == ("rig", "tof", 1.0)
    x, y, z, w = pose.to_quaternion(CAMERA.T_rs)
    assert (color.rotation.x, color.rotation.y, color.rotation.z, color.rotation.w) == (x, y, z, w)


def test_a_fisheye_camera_is_published_and_restored_from_recordings():
    camera = dataclasses.replace(CAMERA, lens=KannalaBrandt(np.array([0.1, 0.02])))
    told = sensor_metadata.calibration("tof", camera, 0)
    assert (told.distortion_model, list(told.D)) == ("kannala_brandt", [0.1, 0.02, 0, 0])
    model = sensor_metadata.sensor_model(Header(), "tof", camera, {})
    assert (
        decode_camera(SensorModel.FromString(model.SerializeToString())).calib_id == camera.calib_id == model.calib_id
    )
    model.lens_model = ""
    assert decode_camera(model).lens.name == "brown_conrady"  # a recording from before there were fisheyes
    model.lens_model = "mirror"
    with pytest.raises(CodecError, match=r'lens_model = "mirror" is none of'):
        decode_camera(model)


def test_a_head_that_the_device_does_not_have_is_explained(metadata):
    _, metadata = metadata
    with pytest.raises(HeadError, match=r'sensors\.color: device "cam" has no head "other"; it has: head'):
        metadata.add_device("cam", FakeDevice(heads=["head"]))


def test_a_step_of_the_wall_clock_is_reported_once(metadata):
    bus, metadata = metadata
    now = {"monotonic": 10**9, "wall": 10**18}
    clock = WallClock(lambda: now["monotonic"], lambda: now["wall"])
    health = Health(bus, "capture", HeaderFactory("demo", clock))
    levels = []
    for step_ns in (0, 3600 * 10**9, 0):
        now["monotonic"] += 10**9
        now["wall"] += 10**9 + step_ns
        command.tick(metadata, {}, health, clock)
        levels.append((health.level, health_now(health, bus).counters["clock_steps"]))
    assert levels == [(Level.OK, 0), (Level.WARNING, 1), (Level.OK, 1)]
    said = [Message.FromString(sample.payload).message for sample in bus.sent if sample.topic == "health/capture"]
    assert "the wall clock was set by +3600.000 s; stamps follow it" in said


def test_the_schema_describes_every_message_on_the_wire():
    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(sensor_metadata.schema()).file:
        pool.Add(file)
    for message in MESSAGES:
        assert pool.FindMessageTypeByName(message).full_name == message
    assert keys.SCHEMA == "schema"
