from dataclasses import replace

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.sensor_model_pb2 import SensorModel

from abs_service.capture.sensor_metadata import sensor_model
from abs_service.tracking.monitors.calibration_monitor import CalibrationMonitor
from calib.camera import Camera

CAMERA = Camera(160, 120, 200.0, 200.0, 79.5, 59.5)


def model(camera, sensor="tof"):
    return sensor_model(Header(), sensor, camera, {})


@pytest.fixture
def monitor():
    return CalibrationMonitor({"tof": CAMERA})


def test_another_calibration_is_noticed(monitor):
    other = model(replace(CAMERA, fx=201.0))
    monitor.take(other)
    assert not monitor.changed.is_set()
    monitor.take(other)
    assert monitor.changed.is_set()


def test_what_two_processes_publish_in_turns_is_no_change_nor_are_other_sensors_or_what_is_no_camera(monitor):
    for _ in range(3):
        for one in (model(CAMERA), model(replace(CAMERA, cx=70.0)), model(CAMERA), model(replace(CAMERA, cx=9.0), "b")):
            monitor.take(one)
        monitor.take(SensorModel(sensor="tof", width=1, T_rs=[1.0]))
    assert not monitor.changed.is_set()
