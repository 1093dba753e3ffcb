"""An emulated Azure Kinect, whose captures Microsoft's library makes: numbers, losses, controls, what is sent."""

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from drivers.azure import library, open_device
from drivers.azure.device import AzureDevice
from drivers.contract.capabilities import SyncRole
from drivers.contract.device import ControlError, DeviceError, DeviceState, SdkMissingError
from drivers.contract.frame import Geometry, Kind, Reference
from tests.drivers.azure.attachment import attached
from tests.drivers.azure.emulation import BEGIN_US, EmulatedKinect
from tests.drivers.azure.test_mkv import CALIBRATION
from tests.drivers.conformance.bench import Fault, streaming
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually

try:
    library.load()
except SdkMissingError as error:
    pytest.skip(str(error), allow_module_level=True)

SERIAL = "000123456712"


@pytest.fixture
def camera(tmp_path: Path) -> Iterator[EmulatedKinect]:
    made = EmulatedKinect(SERIAL, CALIBRATION)
    with attached(tmp_path, made):
        yield made


def opened(query: str = "") -> AzureDevice:
    return open_device(f"azure://?{query}" if query else "azure://", time.monotonic_ns)


def received(query: str, frames: int) -> RecordingSink:
    with streaming(opened(query)) as sink:
        assert sink.receives(frames)
    return sink


def test_frames_say_what_the_camera_says_of_them(camera: EmulatedKinect) -> None:
    device = opened("depth=wfov_2x2binned")
    assert (device.info.uri, device.info.serial) == (f"azure://{SERIAL}?depth=wfov_2x2binned", SERIAL)
    assert (device.info.firmware, device.info.link) == ("colour 1.6.110, depth 1.6.80", "USB, 5000 Mbit/s")
    with streaming(device) as sink:
        sink.wait(lambda: len(sink.of("color")) > 3)
    depth, amplitude, color = (sink.of(stream)[0] for stream in ("depth", "amplitude", "color"))
    assert (depth.kind, amplitude.kind, color.kind) == (Kind.DEPTH, Kind.AMPLITUDE, Kind.COLOR)
    assert (depth.geometry, depth.scale, depth.invalid, depth.data.shape) == (Geometry.Z, 0.001, 0.0, (512, 512))
    assert (depth.t_device_ticks, color.t_device_ticks) == (BEGIN_US, BEGIN_US + 20)
    assert depth.t_reference == Reference.MIDDLE
    assert (depth.modulation, color.modulation) == ("WFOV_2X2BINNED", "")
    assert color.exposure_s == pytest.approx(0.00833)
    assert np.isnan(depth.exposure_s)
    assert depth.temperature_c == 31.5
    assert (color.encoding, color.data.shape) == ("bgr8", (720, 1280, 3))
    assert np.all(np.abs(color.data.astype(int) - [200, 100, 50]) < 6)


@pytest.mark.parametrize(
    ("query", "streams"),
    [
        ("", {"depth/depth", "depth/amplitude", "color/color"}),
        ("amplitude=0&color=0", {"depth/depth"}),
        ("depth=0&format=nv12", {"color/color"}),
        ("depth=0&format=yuy2", {"color/color"}),
        ("depth=0&format=bgra", {"color/color"}),
        ("depth=passive_ir&color=0", {"depth/ir"}),
    ],
)
def test_an_address_chooses_streams(camera: EmulatedKinect, query: str, streams: set[str]) -> None:
    device = opened(query)
    assert {f"{one.sensor}/{one.stream}" for one in device.capabilities.streams} == streams
    with streaming(device) as sink:
        assert eventually(lambda: {"/".join(frame.key) for frame in list(sink.frames)} == streams)
    assert {cause for cause, number in device.counters.items() if number} <= {"frames", "after_stop", "overrun"}


def test_an_exposure_that_is_lost_is_counted_for_its_head_alone(camera: EmulatedKinect) -> None:
    camera.silent = {2: "depth", 3: "depth", 5: "color"}
    device = opened("depth=nfov_2x2binned")
    with streaming(device) as sink:
        sink.wait(lambda: len(sink.of("color")) > 6)
    assert [frame.seq for frame in sink.of("depth")][:5] == [0, 1, 4, 5, 6]
    assert [frame.seq for frame in sink.of("amplitude")][:5] == [0, 1, 4, 5, 6]
    assert [frame.seq for frame in sink.of("color")][:6] == [0, 1, 2, 3, 4, 6]
    assert device.counters["missing"] == 2 * 2 + 1


def test_what_ended_the_streams_is_in_the_reason(camera: EmulatedKinect) -> None:
    camera.fault = Fault.UNPLUG
    device = opened("depth=nfov_2x2binned")
    with streaming(device) as sink:
        reason = sink.wait_for(DeviceState.FAILED)
    assert "the camera has ended its streams, or is gone" in reason
    assert [len(sink.of(stream)) for stream in ("depth", "amplitude")] == [camera.after] * 2
    assert len(sink.of("color")) + device.counters["overrun"] == camera.after, "those that waited came before the end"


def test_synchronisation_and_delays_are_sent_when_streams_start(camera: EmulatedKinect) -> None:
    device = opened("depth=nfov_unbinned&color=1080p&fps=15")
    assert device.capabilities.sync_roles == (SyncRole.FREE, SyncRole.MASTER, SyncRole.SLAVE)
    for name, value in (("sync_role", "slave"), ("sync_delay_s", 0.0005), ("depth_delay_s", -0.00016)):
        device.controls.set(name, value)
    with streaming(device):
        device.controls.set("sync_role", "slave")
        with pytest.raises(DeviceError, match="sync_role is set before the streams start"):
            device.controls.set("sync_role", "master")
    (sent,) = camera.started
    assert (sent.depth_mode, sent.color_resolution, sent.color_format, sent.camera_fps) == (2, 2, 0, 1)
    assert (sent.wired_sync_mode, sent.subordinate_delay_off_master_usec) == (2, 500)
    assert sent.depth_delay_off_color_usec == -160
    assert not sent.synchronized_images_only


def test_a_delay_is_sent_for_a_slave_only_and_a_master_takes_colours(camera: EmulatedKinect) -> None:
    device = opened("color=0")
    assert device.capabilities.sync_roles == (SyncRole.FREE, SyncRole.SLAVE)
    with pytest.raises(ControlError, match=r"sync_role = .* must be one of free, slave"):
        device.controls.set("sync_role", "master")
    device.controls.set("sync_delay_s", 0.0005)
    with streaming(device):
        pass
    assert (camera.started[0].wired_sync_mode, camera.started[0].subordinate_delay_off_master_usec) == (0, 0)


def test_controls_are_in_si_units_and_setting_a_number_ends_its_automatic(camera: EmulatedKinect) -> None:
    device = opened()
    assert device.controls.get("color.auto_exposure") is True
    for exposure_s in (0.0166, device.controls.get("color.exposure_s")):  # what is read stays when it is set
        device.controls.set("color.exposure_s", exposure_s)
        assert (device.controls.get("color.auto_exposure"), camera.controls[0]) == (False, (1, 16_670))
    device.controls.set("color.white_balance", 4504)
    assert device.controls.get("color.white_balance") == 4500
    device.controls.set("color.auto_white_balance", True)
    assert camera.controls[6] == (0, 4500)
    device.controls.set("color.mains_hz", "50")
    assert camera.controls[9] == (1, 1)
    device.close()
    with pytest.raises(DeviceError, match="was closed"):
        device.controls.get("color.gain")


def test_an_unsupported_calibration_closes_the_camera(camera: EmulatedKinect) -> None:
    camera.calibration = CALIBRATION.replace(b"BrownConrady", b"Rational6KT")
    with pytest.raises(DeviceError, match="Rational6KT"):
        opened()
    assert not camera.open
