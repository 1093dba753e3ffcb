"""Discovery and opening of attached cameras: the list of cameras is emulated, the camera is a playback of the SDK's."""

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.contract.device import DeviceError, DeviceState, SdkMissingError
from drivers.contract.discovery import Availability
from drivers.orbbec import discover, library, open_device
from tests.drivers.orbbec import takes
from tests.drivers.recording_sink import RecordingSink

pytest.importorskip("rosbags", reason="make all")
try:
    ob = library.load()
except SdkMissingError as error:
    pytest.skip(str(error), allow_module_level=True)

SERIAL = "CL8FC3100XX"


class Attached:
    """The SDK's context and its list of devices.

    Attributes:
        serials: of the attached cameras; "" for one that may not be read.
        asked: addresses and ports of cameras on the network that were opened.
    """

    def __init__(self, take: Path) -> None:
        self.context = library.context(ob)
        self.take = take
        self.serials = [SERIAL]
        self.asked: list[tuple[str, int]] = []

    def query_devices(self) -> Any:
        return self

    def get_count(self) -> int:
        return len(self.serials)

    def get_device_serial_number_by_index(self, number: int) -> str:
        return self.serials[number]

    def get_device_name_by_index(self, number: int) -> str:
        return "Orbbec Femto Bolt"

    def get_device_connection_type_by_index(self, number: int) -> str:
        return "USB3.1"

    def get_device_by_serial_number(self, serial: str) -> Any:
        assert serial in self.serials
        return ob.PlaybackDevice(str(self.take))

    def create_net_device(self, host: str, port: int) -> Any:
        self.asked.append((host, port))
        return ob.PlaybackDevice(str(self.take))


@pytest.fixture
def attached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Attached:
    takes.write(tmp_path / "take.bag", SERIAL, images=10)
    made = Attached(tmp_path / "take.bag")
    names = {name: getattr(ob, name) for name in dir(ob) if not name.startswith("_")}
    sdk = SimpleNamespace(**names | {"Context": lambda path: made})
    monkeypatch.setattr(library, "load", lambda: sdk)
    return made


def test_attached_cameras_are_listed_and_the_only_one_is_opened_by_its_serial_number(attached: Attached) -> None:
    (found,) = discover(0.1)
    assert (found.info.uri, found.availability) == (f"orbbec://{SERIAL}", Availability.READY)
    assert (found.info.model, found.info.link) == ("Orbbec Femto Bolt", "USB3.1")
    device = open_device("orbbec://?color=0", time.monotonic_ns)
    device.close()
    assert device.info.uri == f"orbbec://{SERIAL}?color=0"
    assert {stream.sensor for stream in device.capabilities.streams} == {"depth"}
    assert device.capabilities.regular


def test_of_several_cameras_one_has_to_be_named(attached: Attached) -> None:
    attached.serials.append("CL8FC3100YY")
    with pytest.raises(DeviceError, match="2 orbbec devices are attached; say which one"):
        open_device("orbbec://", time.monotonic_ns)
    open_device(f"orbbec://{SERIAL}", time.monotonic_ns).close()


def test_a_camera_that_may_not_be_read_says_what_to_do(attached: Attached) -> None:
    attached.serials[0] = ""
    (found,) = discover(0.1)
    assert found.availability == Availability.NO_PERMISSION
    with pytest.raises(DeviceError, match=r"60-abs-service\.rules"):
        open_device("orbbec://", time.monotonic_ns)


def test_a_camera_that_is_listed_no_more_is_gone(attached: Attached) -> None:
    device, sink = open_device("orbbec://", time.monotonic_ns), RecordingSink()
    try:
        device.start(sink)
        assert sink.receives(1)
        time.sleep(1.5)  # it has fallen silent, but is listed
        assert device.state == DeviceState.STREAMING
        attached.serials.clear()
        assert sink.wait_for(DeviceState.FAILED) == "the camera is gone"
    finally:
        device.close()


def test_a_camera_on_the_network_is_opened_by_its_address(attached: Attached) -> None:
    device = open_device("orbbec://192.168.1.10", time.monotonic_ns)
    device.close()
    assert attached.asked == [("192.168.1.10", 8090)]
    assert (device.info.uri, device.info.serial) == ("orbbec://192.168.1.10", SERIAL)
