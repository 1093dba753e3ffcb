"""Addresses, discovery and opening of Azure Kinects."""

import ctypes
import sys
import time
from pathlib import Path
from unittest.mock import patch

import pytest

from drivers.azure import check_address, discover, library, open_device, opening
from drivers.azure.address import parse
from drivers.azure.attached import attached as found_in
from drivers.contract import errors
from drivers.contract.device import AddressError, DeviceError, SdkMissingError
from drivers.contract.discovery import Availability
from tests.drivers.azure.attachment import attached, usb_tree
from tests.drivers.azure.emulation import EmulatedKinect
from tests.drivers.azure.test_mkv import CALIBRATION


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("azure://?speed=2", "unknown key 'speed'; allowed are amplitude, color, depth, format, fps"),
        ("azure://?depth=wide", "depth = 'wide' must be one of 0, nfov_2x2binned, nfov_unbinned"),
        ("azure://?color=480p", "color = '480p' must be one of 0, 720p"),
        ("azure://?fps=60", "fps = '60' must be one of 5, 15, 30"),
        ("azure://?depth=wfov_unbinned&fps=30", "fps = 30 is too fast for wfov_unbinned"),
        ("azure://?color=3072p&fps=30", "fps = 30 is too fast for 3072p"),
        ("azure://?color=1080p&format=nv12", "format = 'nv12' is for color=720p"),
        ("azure://?depth=0&color=0", "leave nothing"),
        ("azure://1/2", "all that may stand before"),
    ],
)
def test_an_invalid_address_is_a_final_error(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        check_address(uri)


def test_the_rate_is_the_highest_that_the_modes_have() -> None:
    assert parse("azure://000123456712").rate_hz == 30
    assert parse("azure://?depth=wfov_unbinned").rate_hz == 15
    assert parse("azure://?color=3072p").rate_hz == 15


def test_cameras_are_listed_by_what_the_kernel_tells_without_opening_them(tmp_path: Path) -> None:
    usb, nodes = usb_tree(tmp_path, "0001", "0002")
    (nodes / "002" / "003").unlink()
    ready, forbidden = found_in(usb, nodes)
    assert (ready.info.uri, ready.info.model, ready.info.link) == (
        "azure://0001",
        "Azure Kinect DK",
        "USB, 5000 Mbit/s",
    )
    assert ready.availability == Availability.READY
    assert (forbidden.info.serial, forbidden.availability) == ("0002", Availability.NO_PERMISSION)
    assert "60-abs-service.rules" in forbidden.remedy
    assert found_in(tmp_path / "none", nodes) == []


def test_a_camera_that_a_program_has_opened_is_busy(tmp_path: Path) -> None:
    (found,) = found_in(*usb_tree(tmp_path, "0001", driver="usbfs"))
    assert found.availability == Availability.BUSY


def test_without_the_sdk_the_driver_says_what_installs_it() -> None:
    library.load.cache_clear()
    try:
        nowhere = patch.object(library, "_names", lambda: iter(["libk4a-that-is-not-there.so"]))
        with nowhere, patch.object(errors, "PYTHON", (3, 11)):
            (found,) = discover(0.1)
            assert (found.availability, found.remedy) == (
                Availability.SDK_MISSING,
                ".venv/bin/pip install --no-deps pyk4a-bundle",
            )
            with pytest.raises(SdkMissingError, match="pyk4a-bundle is not installed"):
                open_device("azure://", time.monotonic_ns)
    finally:
        library.load.cache_clear()


@pytest.fixture
def with_sdk() -> None:
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(str(error))


@pytest.mark.usefixtures("with_sdk")
def test_of_several_cameras_the_one_with_the_serial_number_is_opened(tmp_path: Path) -> None:
    cameras = [EmulatedKinect(serial, CALIBRATION) for serial in ("0001", "0002", "0003")]
    cameras[0].open = True  # by another program; the SDK numbers it all the same
    with attached(tmp_path, *cameras):
        with pytest.raises(DeviceError, match="3 azure devices are attached; say which one"):
            open_device("azure://", time.monotonic_ns)
        with pytest.raises(DeviceError, match="azure://0009 is not attached; attached: azure://0001"):
            open_device("azure://0009", time.monotonic_ns)
        with pytest.raises(DeviceError, match="0001 cannot be opened"):
            open_device("azure://0001", time.monotonic_ns)
        device = open_device("azure://0003", time.monotonic_ns)
        assert [camera.open for camera in cameras] == [True, False, True]
        assert device.info.uri == "azure://0003"
        device.close()
        device.close()
        assert not cameras[2].open


@pytest.mark.usefixtures("with_sdk")
def test_the_real_library_without_a_camera_gives_its_reason_and_prints_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    sdk = library.load()
    if sdk.k4a_device_get_installed_count():
        pytest.skip("a camera is attached")
    usb, nodes = usb_tree(tmp_path, "0001")
    with (
        patch.object(opening, "USB", usb),
        patch.object(opening, "NODES", nodes),
        pytest.raises(DeviceError, match=r"0001 cannot be opened: .*No devices found"),
    ):
        open_device("azure://0001", time.monotonic_ns)
    library.forget()
    assert sdk.k4a_device_open(0, ctypes.byref(ctypes.c_void_p())) != 0
    assert "Is the device being used by another application?" in library.reason()
    sys.stdout.flush()
    assert capfd.readouterr() == ("", "")
