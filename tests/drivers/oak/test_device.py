"""The OAK driver on the real depthai without a device: playback of a recording, and mocks with depthai's interface."""

import json
import os
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from drivers.contract.device import AddressError, DeviceError, DeviceState, SdkMissingError
from drivers.contract.frame import Kind
from drivers.oak import discover, eeprom, library, open_device
from drivers.oak.address import parse
from drivers.oak.device import OakDevice
from drivers.oak.images.messages import Queue, from_img_frame
from drivers.oak.images.picture import Picture
from drivers.oak.images.recording import OakRecording
from drivers.oak.roles import ROLES
from drivers.oak.source import playback
from drivers.simulated.address import parse as parse_simulated
from tests.drivers.recording_sink import RecordingSink
from tests.sample import oak

try:
    dai = library.load()
except SdkMissingError as error:
    pytest.skip(f"{error}, or  make all", allow_module_level=True)


SAMPLE = Path(__file__).parents[3] / "recordings" / "sample_oak"


URI = f"oak://?recording={SAMPLE}"


def test_playback_by_depthai_is_bit_exact(tmp_path: Path) -> None:
    simulation = parse_simulated("simulated://sheet?sensors=tof&tof=32x24&rate=15").build()
    camera = simulation.heads["tof"].camera
    depths = [frame for k in range(30) for frame in simulation.frames(k) if frame.kind == Kind.DEPTH]
    oak.record(tmp_path / "tof_depth.mcap", [oak.message(frame, camera, 0) for frame in depths])
    recorded = {frame.seq: frame for frame in OakRecording(tmp_path).frames()}
    receiver = RecordingSink()
    device = open_device(f"oak://?recording={tmp_path}&loop=0", time.monotonic_ns)
    try:
        assert device.state == DeviceState.CLOSED
        assert [stream.key for stream in device.capabilities.streams] == [("tof", "depth")]
        device.start(receiver)
        receiver.wait(lambda: receiver.states[-1] == (DeviceState.CLOSED, "the recording has ended"))
    finally:
        device.close()
    assert [state for state, _ in receiver.states] == [DeviceState.OPENING, DeviceState.STREAMING, DeviceState.CLOSED]
    assert len(recorded) == 30
    assert len(receiver.frames) == device.counters["frames"] > 10
    for frame in receiver.frames:
        same = recorded[frame.seq]
        np.testing.assert_array_equal(frame.data, same.data)
        assert (frame.t_device_ticks, frame.exposure_s) == (same.t_device_ticks, same.exposure_s)
        assert frame.calib_id == same.calib_id
        assert frame.t_host_ns <= frame.t_arrival_ns


def test_streams_of_one_exposure_have_one_time_and_starting_again_is_a_new_epoch() -> None:
    receiver = RecordingSink()
    device = open_device(URI, time.monotonic_ns)
    try:
        for epoch in range(3):
            device.start(receiver)
            device.start(receiver)  # it runs already
            receiver.wait(partial(has_frames, receiver, epoch, 9))
            device.stop()
            assert receiver.settle() == len(receiver.frames)
    finally:
        device.close()
        device.close()
    with pytest.raises(DeviceError, match="closed"):
        device.start(receiver)
    times: dict[tuple[int, int], set[int]] = {}
    for frame in receiver.frames:
        times.setdefault((frame.epoch, frame.seq), set()).add(frame.t_host_ns)
    assert {frame.epoch for frame in receiver.frames} == {0, 1, 2}
    assert all(max(stamps) - min(stamps) < 1e6 for stamps in times.values())


def has_frames(receiver: RecordingSink, epoch: int, number: int) -> bool:
    return sum(frame.epoch == epoch for frame in receiver.frames) >= number


def live_connection() -> Any:
    """A playback whose end is reported as the loss of a device."""
    return replace(playback.connect(parse(URI), SAMPLE), ended="")


def test_a_stream_without_images_is_named() -> None:
    silent = MagicMock()
    silent.get.return_value = None
    connection = live_connection()
    connection = replace(connection, queues={**connection.queues, ROLES["tof_confidence"]: silent})
    with pytest.raises(DeviceError, match=r"tof/confidence delivers nothing for 0.1 s"):
        OakDevice(connection, time.monotonic_ns, first_s=0.1)


def test_malformed_messages_are_counted_and_the_stream_continues() -> None:
    class Odd:
        """A queue whose third message is malformed."""

        def __init__(self, queue: Queue) -> None:
            self.queue, self.count = queue, 0

        def get(self, timeout_s: float) -> Picture | None:
            self.count += 1
            return from_img_frame(dai.IMUData()) if self.count == 3 else self.queue.get(timeout_s)

        def clear(self) -> None:
            self.queue.clear()

    connection = live_connection()
    connection = replace(connection, queues={role: Odd(queue) for role, queue in connection.queues.items()})
    device, receiver = OakDevice(connection, time.monotonic_ns), RecordingSink()
    try:
        device.start(receiver)
        receiver.wait(lambda: len(receiver.frames) > 9)
        assert device.counters["undecodable"] == len(connection.queues)
    finally:
        device.close()


def test_frames_of_a_time_of_flight_camera_have_its_range() -> None:
    connection = replace(live_connection(), modulation=lambda role, t: "high" if role.sensor == "tof" else "")
    device, receiver = OakDevice(connection, time.monotonic_ns), RecordingSink()
    try:
        device.start(receiver)
        receiver.wait(lambda: {frame.sensor for frame in receiver.frames} == {"tof", "color"})
    finally:
        device.close()
    assert {(frame.sensor, frame.modulation) for frame in receiver.frames} == {("tof", "high"), ("color", "")}


def test_frames_of_an_uncertain_range_are_dropped_and_counted() -> None:
    connection = replace(live_connection(), modulation=lambda role, t: None if role.sensor == "tof" else "")
    device, receiver = OakDevice(connection, time.monotonic_ns), RecordingSink()
    try:
        device.start(receiver)
        receiver.wait(lambda: len(receiver.frames) > 2)
    finally:
        device.close()
    assert {frame.sensor for frame in receiver.frames} == {"color"}
    assert device.counters["range_changes"] > 2


def test_images_bring_the_pose_of_their_view() -> None:
    camera = parse_simulated("simulated://sheet?sensors=tof&tof=32x24").build()
    frame = next(frame for frame in camera.frames(0) if frame.kind == Kind.DEPTH)
    message = oak.message(frame, camera.heads["tof"].camera, 2)
    assert from_img_frame(message).extrinsics.to == -1
    transformation = message.getTransformation()
    turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    transformation.setExtrinsics(dai.Extrinsics(turn, dai.Point3f(7.5, 0, 1), dai.CameraBoardSocket.CAM_A))
    message.setTransformation(transformation)
    picture = from_img_frame(message, socket=1)
    assert (picture.socket, picture.extrinsics.to) == (1, 0)
    np.testing.assert_allclose(picture.extrinsics.T_to_camera[:3, 3], (0.075, 0, 0.01), atol=1e-7)
    np.testing.assert_allclose(picture.extrinsics.T_to_camera[:3, :3], turn)


def test_the_calibration_is_depthais_own() -> None:
    simulation = parse_simulated("simulated://sheet?tof=88x72&color=128x96").build()
    cameras = {0: simulation.heads["tof"].camera, 2: simulation.heads["color"].camera}
    handler = oak.calibration(cameras)
    turn = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    A, B = dai.CameraBoardSocket.CAM_A, dai.CameraBoardSocket.CAM_B
    handler.setCameraIntrinsics(B, [[9.0, 0, 4], [0, 9, 3], [0, 0, 1]], 8, 6)
    handler.setCameraExtrinsics(B, dai.CameraBoardSocket.CAM_C, turn, [1.0, -2.0, 3.0], [1.0, -2.0, 3.0])
    handler.setStereoLeft(A, turn)
    poses = eeprom.parse(json.dumps(handler.eepromToJson()))
    for reference in (0, 1, 2):
        for socket in (0, 1, 2):
            theirs = handler.getCameraExtrinsics(
                dai.CameraBoardSocket(socket), dai.CameraBoardSocket(reference), unit=dai.LengthUnit.METER
            )
            np.testing.assert_allclose(poses.between(reference, socket), theirs, atol=1e-6)
    np.testing.assert_allclose(poses.rectified(0)[:3, :3], handler.getStereoLeftRectificationRotation())


def test_projection_between_cameras_agrees_with_depthais() -> None:
    """Reference: depthai's own projection of a pixel with depth from one image to another."""
    read = OakRecording(SAMPLE)
    tof, color = read.cameras["tof"], read.cameras["color"]
    pixel, z = np.array([30.0, 50.0]), 1.1
    point = tof.directions(pixel) / tof.directions(pixel)[2] * z

    def transformation(camera: Any) -> Any:
        matrix = [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]]
        made = dai.ImgTransformation(camera.width, camera.height, matrix)
        T = camera.T_rs.copy()
        T[:3, 3] *= 100
        made.setExtrinsics(dai.Extrinsics(T.tolist(), dai.CameraBoardSocket.CAM_A))
        return made

    theirs = transformation(tof).projectPointTo(transformation(color), dai.Point2f(*pixel), 1000 * z)
    np.testing.assert_allclose(color.project(point), (theirs.x, theirs.y), atol=0.6)


def test_no_device_raises_at_once_without_network_traffic() -> None:
    assert os.environ["DEPTHAI_TELEMETRY"] == "0"
    assert os.environ["DEPTHAI_PROTOCOL"] == "usb"
    assert discover(0.2) == []
    with pytest.raises(DeviceError, match="no oak device is attached"):
        open_device("oak://", time.monotonic_ns)
    with pytest.raises(DeviceError, match="oak://18443010: no such device is attached"):
        open_device("oak://18443010", time.monotonic_ns)


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("oak://?speed=2", "unknown key 'speed'; allowed are color, dots"),
        ("oak://?mode=lidar", "mode = 'lidar' must be one of auto, tof, stereo"),
        ("oak://?fps=1000", "fps = '1000' must be a number from 1 to 120"),
        ("oak://?dots=bright", "dots = 'bright' must be a number from 0 to 1"),
        ("oak://?size=big", "size = 'big' must be WIDTHxHEIGHT"),
        ("oak://1844/x", "all that may stand before"),
        ("oak://?recording=nowhere", "nowhere"),
    ],
)
def test_an_invalid_address_is_a_final_error(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        open_device(uri, time.monotonic_ns)


def test_network_discovery_is_opt_in() -> None:
    assert not parse("oak://18443010E1A2B3C4").network
    assert parse("oak://192.168.1.44").network
    assert parse("oak://?network=1").network
