"""Cameras, noise models and poses of the sensors are published with the configuration."""

import dataclasses
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
from abs_service.capture import sensor_metadata
from abs_service.capture.metadata_publisher import MetadataPublisher
from abs_service.commands.parts import rig_devices
from abs_service.commands.parts.rig_devices import HeadError
from abs_service.commands.processes import capture as command
from abs_service.wire.checked_bus import CheckedBus
from abs_service.wire.message_header import MESSAGES
from calib import pose
from calib.lenses.fisheye import KannalaBrandt
from drivers.encoding.parsing import CodecError
from drivers.encoding.sensor_model import decode_camera
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.abs_service.capture.fake_device import CAMERA, FakeDevice

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
def rig(tmp_path):
    return config.loads(RIG, "rig.toml", tmp_path)


@pytest.fixture
def metadata(rig):
    bus = LoopbackBus()
    return bus, MetadataPublisher(bus, HeaderFactory("demo", WallClock()), rig_devices.configured_sensors(rig))


def test_what_the_sensors_are_is_announced_with_the_calibration_of_the_configuration(rig, metadata):
    bus, metadata = metadata
    metadata.add(rig_devices.cameras(rig, "cam", FakeDevice()))
    published = {sample.topic: sample.payload for sample in bus.query("**", 1)}
    assert set(published) == {"config", "tf", "tof/model", "tof/calibration", "color/model", "color/calibration"}
    model = SensorModel.FromString(published["tof/model"])
    assert (model.noise, model.fx, model.width) == ("gaussian_polynomial", 5.0, 4)
    assert list(model.noise_parameters["sigma"].values) == [1e-2, 2e-3]
    assert list(model.noise_parameters["outlier_share"].values) == [0.1]
    assert "range_m" not in model.noise_parameters
    assert np.reshape(model.T_rs, (4, 4))[:3, 3].tolist() == [0.1, 0.2, 0.3]
    assert SensorModel.FromString(published["color/model"]).calib_id == CAMERA.calib_id
    calibration = CameraCalibration.FromString(published["tof/calibration"])
    assert list(calibration.K) == [5, 0, 1.5, 0, 5, 1.0, 0, 0, 1]
    assert (calibration.frame_id, len(calibration.D), len(calibration.P)) == ("tof", 8, 12)
    assert "[sensors.tof]" in Config.FromString(published["config"]).toml
    tof, color = FrameTransforms.FromString(published["tf"]).transforms
    assert (tof.parent_frame_id, tof.child_frame_id, tof.rotation.w) == ("rig", "tof", 1.0)
    x, y, z, w = pose.to_quaternion(CAMERA.T_rs)
    assert (color.rotation.x, color.rotation.y, color.rotation.z, color.rotation.w) == (x, y, z, w)


def test_a_fisheye_camera_is_published_and_restored_from_recordings():
    camera = dataclasses.replace(CAMERA, lens=KannalaBrandt(np.array([0.1, 0.02])))
    calibration = sensor_metadata.calibration("tof", camera, 0)
    assert (calibration.distortion_model, list(calibration.D)) == ("kannala_brandt", [0.1, 0.02, 0, 0])
    model = sensor_metadata.sensor_model(Header(), "tof", camera, {})
    assert (
        decode_camera(SensorModel.FromString(model.SerializeToString())).calib_id == camera.calib_id == model.calib_id
    )
    model.lens_model = ""
    assert decode_camera(model).lens.name == "brown_conrady"  # a recording from before there were fisheyes
    model.lens_model = "mirror"
    with pytest.raises(CodecError, match=r'lens_model = "mirror" is none of'):
        decode_camera(model)


def test_another_configuration_while_all_is_published_comes_with_the_next_time(rig, metadata, tmp_path):
    bus, metadata = metadata
    metadata.add(rig_devices.cameras(rig, "cam", FakeDevice()))
    other = rig_devices.configured_sensors(config.loads(RIG.replace("1e-2", "5e-2"), "rig.toml", tmp_path))
    threads = []

    def reload(_):
        if not threads:
            threads.append(threading.Thread(target=metadata.configure, args=(other,)))
            threads[0].start()
            threads[0].join(0.2)

    bus.subscribe("config", reload)

    def sigma():
        metadata.publish()
        published = {sample.topic: sample.payload for sample in bus.query("**", 1)}
        values = SensorModel.FromString(published["tof/model"]).noise_parameters["sigma"].values
        return values[0], str(values[0]) in Config.FromString(published["config"]).toml

    assert sigma() == (1e-2, True)
    threads[0].join()
    assert sigma() == (5e-2, True)


def test_a_head_that_the_device_does_not_have_is_explained(rig):
    with pytest.raises(HeadError, match=r'sensors\.color: device "cam" has no head "other"; it has: head'):
        rig_devices.cameras(rig, "cam", FakeDevice(heads=["head"]))


def test_a_step_of_the_wall_clock_is_reported_once(metadata):
    bus, metadata = metadata
    now = {"monotonic": 10**9, "wall": 10**18}
    clock = WallClock(lambda: now["monotonic"], lambda: now["wall"])
    health = Health(bus, "capture", HeaderFactory("demo", clock))
    levels = []
    for step_ns in (0, 3600 * 10**9, 0):
        now["monotonic"] += 10**9
        now["wall"] += 10**9 + step_ns
        command.tick(CheckedBus(bus, clock.monotonic), metadata, {}, {}, health, clock)
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
