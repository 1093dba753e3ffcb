"""Opening RealSense cameras: addresses, and cameras that are not there or unplugged meanwhile."""

import time
from types import SimpleNamespace

import pytest

from drivers.contract.device import AddressError, DeviceError, SdkMissingError
from drivers.realsense import device as realsense_device
from drivers.realsense import library, open_device
from drivers.realsense.opening import device_info, discover, of_device
from tests.drivers.realsense.software_camera import SoftwareCamera

try:
    rs = library.load()
except SdkMissingError as error:
    pytest.skip(f"{error}, or  make all", allow_module_level=True)


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("realsense://?speed=2", "unknown key 'speed'; allowed are color, confidence, depth"),
        ("realsense://?depth=big", "depth = 'big' must be a width and a height"),
        ("realsense://?fps=0", "fps = '0' must be a number from 1 to 999"),
        ("realsense://?ir=2", r"ir = '2' must be 0, 1 \(as depth\) or a width and a height"),
        ("realsense://?color=640x480@", "color = '640x480@' must be a width and a height"),
        ("realsense://1/2", "all that may stand before"),
        ("realsense://?recording=nowhere.db3", "nowhere.db3 cannot be played"),
    ],
)
def test_an_invalid_address_is_a_final_error(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=complaint):
        open_device(uri, time.monotonic_ns)


def test_no_camera_raises() -> None:
    assert discover(0.1) == []
    with pytest.raises(DeviceError, match="no realsense device is attached"):
        open_device("realsense://", time.monotonic_ns)
    with pytest.raises(DeviceError, match="realsense://123 is not attached"):
        open_device("realsense://123", time.monotonic_ns)


def test_a_camera_that_is_unplugged_while_it_is_opened_is_named(
    camera: SoftwareCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    attached = iter([[camera.device], []])
    bus = SimpleNamespace(query_devices=lambda: next(attached))
    monkeypatch.setattr(library, "load", lambda: SimpleNamespace(camera_info=rs.camera_info, context=lambda: bus))
    with pytest.raises(DeviceError, match=r"^realsense://0001: 0001 was unplugged while it was opened$"):
        open_device("realsense://0001", time.monotonic_ns)


def test_a_camera_that_is_unplugged_while_its_calibration_is_read_is_named(
    camera: SoftwareCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(streams: object) -> None:
        raise RuntimeError("xioctl(VIDIOC_S_FMT) failed")

    monkeypatch.setattr(realsense_device, "cameras", gone)
    with pytest.raises(DeviceError, match=r"^realsense://0001: xioctl"):
        of_device(rs, camera.device, device_info(rs, camera.device), time.monotonic_ns)
