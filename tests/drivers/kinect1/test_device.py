"""The device on fake USB: frames, error messages, and release of resources."""

import errno
import math
import subprocess
import sys
import time
from importlib import resources
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.device import ControlError, DeviceError
from drivers.contract.discovery import Availability
from drivers.contract.frame import Geometry, Kind
from drivers.kinect1 import usb_numbers
from drivers.kinect1.address import Address, parse
from drivers.kinect1.camera import Stream
from drivers.kinect1.device import Kinect1Device
from drivers.kinect1.opening import find, open_camera
from drivers.kinect1.reference_plane import ReferencePlane
from evaluation.service.kinect1_emulation import usb_descriptors
from evaluation.service.kinect1_emulation.bit_packing import unpack
from evaluation.service.kinect1_emulation.emulated_camera import EmulatedKinect, noise
from tests.drivers.kinect1.fake_usb import FakeBackend, FakeDevice, FakeReader
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually

SERIAL = "A00363A01234040A"
BOTH = (Stream.DEPTH, Stream.COLOR)


@pytest.fixture
def fake() -> FakeDevice:
    return FakeDevice(noise(), SERIAL)


def opened(fake: FakeDevice, streams: tuple[Stream, ...] = BOTH, **of_backend: bool) -> Kinect1Device:
    backend = FakeBackend([fake], **of_backend)
    return open_camera(Address("", streams), time.monotonic_ns, lambda: backend, FakeReader)


def test_depth_in_metres_and_raw_mosaic(fake: FakeDevice) -> None:
    fake.pace = math.inf
    device, sink = opened(fake), RecordingSink()
    device.start(sink)
    sink.wait(lambda: min(len(sink.of("depth")), len(sink.of("bayer"))) >= 4)
    device.close()
    table = np.nan_to_num(ReferencePlane().z())
    packet_streams = fake.kinect.packet_streams
    for frame in sink.of("depth")[:4]:
        raw = unpack(packet_streams["depth"].shown(frame.t_device_ticks // 2_000_000), 11)
        assert (frame.kind, frame.geometry, frame.encoding) == (Kind.DEPTH, Geometry.Z, "16UC1")
        np.testing.assert_allclose(
            np.nan_to_num(frame.si()).ravel(), np.where(table < 13.1, table, 0)[raw], atol=1.1e-4
        )
    for frame in sink.of("bayer")[:4]:
        assert (frame.kind, frame.encoding, frame.data.shape) == (Kind.BAYER, "bayer_grbg8", (480, 640))
        assert frame.data.tobytes() == packet_streams["color"].shown(frame.t_device_ticks // 2_000_000)
        assert frame.calib_id == device.cameras["color"].calib_id
    assert device.counters["frames"] == len(sink.frames)


def test_infrared_instead_of_color(fake: FakeDevice) -> None:
    fake.pace = math.inf
    device, sink = opened(fake, (Stream.IR,)), RecordingSink()
    assert {camera.height for camera in device.cameras.values()} == {488}
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= 2)
    device.close()
    first = sink.frames[0]
    raw = unpack(fake.kinect.packet_streams["ir"].shown(first.t_device_ticks // 2_000_000), 10)
    np.testing.assert_array_equal(first.data.ravel(), raw)
    assert "exposure_s" not in [control.name for control in device.capabilities.controls]


def test_timestamps_are_equidistant_and_of_the_first_packet(fake: FakeDevice) -> None:
    device, sink = opened(fake, (Stream.DEPTH,)), RecordingSink()
    device.start(sink)
    sink.wait(lambda: len(sink.frames) >= 10)
    device.close()
    stamps = np.array([frame.t_host_ns for frame in sink.frames]) * 1e-9
    np.testing.assert_allclose(np.diff(stamps), 1 / 30, atol=5e-3)
    delays = [frame.t_arrival_ns - frame.t_host_ns for frame in sink.frames]
    assert 25e6 < np.median(delays) < 45e6  # the last packet comes 242 microframes after the first
    assert device.gauges["clock.depth/depth.steps"] == 0


def test_controls_reach_the_camera(fake: FakeDevice) -> None:
    device = opened(fake)
    device.controls.set("auto_exposure", False)
    device.controls.set("exposure_s", 0.02)
    device.controls.set("auto_white_balance", False)
    device.controls.set("infrared_gain", 12)
    assert fake.kinect.color_sensor == {0x09: round(0.02 / 54.21e-6), 0x106: 0x0010}
    assert device.controls.get("infrared_gain") == 12
    with pytest.raises(ControlError, match="from 1 to 50"):
        device.controls.set("infrared_gain", 51)
    device.close()
    with pytest.raises(DeviceError, match="closed"):
        device.controls.get("infrared_gain")


def test_closing_in_the_sink_releases_the_camera(fake: FakeDevice) -> None:
    device = opened(fake)

    class Impatient(RecordingSink):
        def on_frame(self, frame) -> None:
            super().on_frame(frame)
            device.close()

    sink = Impatient()
    device.start(sink)
    sink.wait(lambda: len(sink.frames) > 0)
    assert eventually(lambda: (fake.opened, fake.claims, fake.readers) == (0, 0, 0))
    assert len(sink.frames) == 1
    assert fake.kinect.registers[0x06] == 0


def test_a_kernel_driver_is_detached(fake: FakeDevice) -> None:
    fake.kernel_driver = True
    assert find(lambda: FakeBackend([fake]))[0].availability == Availability.READY
    opened(fake).close()
    assert not fake.kernel_driver


def test_a_kernel_driver_that_cannot_be_detached_is_named(fake: FakeDevice) -> None:
    fake.kernel_driver = fake.stubborn = True
    with pytest.raises(DeviceError, match="modprobe -r gspca_kinect"):
        opened(fake)
    assert fake.opened == 0


def test_without_permission_the_message_says_how_to_install_the_udev_rules(fake: FakeDevice) -> None:
    fake.refusal = errno.EACCES
    (found,) = find(lambda: FakeBackend([fake]))
    assert found.availability == Availability.NO_PERMISSION
    with pytest.raises(DeviceError, match=r"abs-service devices --udev .* /etc/udev/rules\.d/60-abs-service\.rules"):
        opened(fake)


def test_a_camera_in_use_cannot_be_opened(fake: FakeDevice) -> None:
    device = opened(fake)
    assert find(lambda: FakeBackend([fake]))[0].availability == Availability.BUSY
    with pytest.raises(DeviceError, match="another program"):
        opened(fake)
    device.close()
    opened(fake).close()


def test_usb_that_cannot_be_searched_is_named() -> None:
    backends = mock.Mock(side_effect=RuntimeError("no libusb-1.0 can be loaded"))
    with pytest.raises(DeviceError, match=r"^kinect1://A1: no libusb-1\.0 can be loaded$"):
        open_camera(parse("kinect1://A1"), time.monotonic_ns, backends, FakeReader)


def test_a_slow_link_is_faulty(fake: FakeDevice) -> None:
    fake.speed = 2
    (found,) = find(lambda: FakeBackend([fake]))
    assert (found.availability, found.info.link) == (Availability.FAULTY, "USB 1, 12 Mbit/s")


def test_a_camera_without_serial_number_has_that_of_its_audio_device() -> None:
    camera = FakeDevice(noise(), "0" * 16, product=0x02BF, ports=(1, 4, 1))
    audio = FakeDevice(EmulatedKinect({}), "B44887234567890B", product=0x02BE, ports=(1, 4, 2))
    elsewhere = FakeDevice(EmulatedKinect({}), "B00000000000001B", product=0x02BE, ports=(1, 5, 2))
    (found,) = find(lambda: FakeBackend([elsewhere, camera, audio], wide=True))
    assert found.info.uri == "kinect1://B44887234567890B"
    assert found.info.model == "Kinect for Windows"
    (found,) = find(lambda: FakeBackend([elsewhere, camera], wide=True))
    assert found.info.serial == ""
    assert camera.opened == audio.opened == elsewhere.opened == 0


def test_the_alternate_setting_with_endpoints_is_selected(fake: FakeDevice) -> None:
    opened(fake, wide=True).close()
    assert fake.settings == [1]


def test_an_unconfigured_camera_is_configured(fake: FakeDevice) -> None:
    fake.configuration = 0
    opened(fake).close()
    assert fake.configuration == 1


def test_two_cameras_are_selected_by_serial_number(fake: FakeDevice) -> None:
    other = FakeDevice(noise(seed=2), "B00363A01234040B", ports=(2, 1))
    backend = FakeBackend([fake, other])
    with pytest.raises(DeviceError, match=f"kinect1://{SERIAL}, kinect1://{other.serial}"):
        open_camera(Address(), time.monotonic_ns, lambda: backend, FakeReader)
    device = open_camera(Address(other.serial), time.monotonic_ns, lambda: backend, FakeReader)
    assert device.info.serial == other.serial
    assert (fake.claims, other.claims) == (0, 1)
    device.close()


@given(st.binary(max_size=40))
def test_a_camera_with_a_garbled_serial_number_is_listed(garbled: bytes) -> None:
    with mock.patch.object(usb_descriptors, "string", return_value=garbled):
        (found,) = find(lambda: FakeBackend([FakeDevice(EmulatedKinect({}), "")]))
    assert found.info.serial.isalnum() or found.info.serial == ""


def test_the_uri_of_an_opened_camera_reopens_it_with_its_streams(fake: FakeDevice) -> None:
    for streams in (BOTH, (Stream.IR,), (Stream.IR, Stream.DEPTH)):
        device = opened(fake, streams)
        assert parse(device.info.uri) == Address(SERIAL, streams)
        device.close()


def test_pyusb_is_imported_lazily() -> None:
    code = "import sys, drivers.kinect1; sys.exit(any(name.split('.')[0] == 'usb' for name in sys.modules))"
    assert (
        subprocess.run([sys.executable, "-c", code], env={"PYTHONPATH": ":".join(sys.path)}, check=False).returncode
        == 0
    )


def test_the_shipped_udev_rules_name_the_camera_and_its_audio_part() -> None:
    shipped = resources.files("drivers.contract").joinpath("60-abs-service.rules").read_text(encoding="utf-8")
    for product in (*usb_numbers.CAMERAS, *usb_numbers.AUDIO):
        assert f'ATTR{{idVendor}}=="{usb_numbers.VENDOR:04x}", ATTR{{idProduct}}=="{product:04x}"' in shipped
