"""Discovery beside Microsoft's library, unmodified, on a USB that umockdev emulates; nobody answers on it."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drivers.azure import library
from drivers.contract.device import SdkMissingError

SERIALS = ("000123456712", "000123456812")
_HUB = ("1d6b", "0003")
#: The parts of a camera that the SDK opens.
_PARTS = (("045e", "097c"), ("045e", "097d"))
_PROGRAM = """
import json, time
from drivers.azure import discover, library, open_device
from drivers.contract.device import DeviceError
number, found = library.load().k4a_device_get_installed_count(), discover(1.0)
try:
    open_device("azure://000123456812", time.monotonic_ns)
except DeviceError as error:
    print(json.dumps([number, [[one.info.uri, one.info.link, one.availability] for one in found], str(error)]))
"""


def test_the_sdk_counts_the_cameras_that_are_listed_and_says_why_none_opens(tmp_path: Path) -> None:
    try:
        library.load()
    except SdkMissingError as error:
        pytest.skip(str(error))
    if not shutil.which("umockdev-run"):
        pytest.skip("umockdev-run is not installed: apt install umockdev")
    described = tmp_path / "usb.umockdev"
    described.write_text("\n".join(_describe(*one) for one in _devices()), encoding="ascii")
    done = subprocess.run(
        ["umockdev-run", "-d", str(described), "--", sys.executable, "-c", _PROGRAM],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    number, found, reason = json.loads(done.stdout)
    assert number == len(SERIALS)
    assert found == [[f"azure://{serial}", "USB, 5000 Mbit/s", "ready"] for serial in SERIALS]
    refused = "libusb_get_bos_descriptor(usbcmd->libusb, &bos_desc) returned LIBUSB_ERROR_IO"  # as nobody answers
    assert reason.startswith(f"azure://000123456812: 000123456812 cannot be opened: {refused}")


def _devices() -> list[tuple[str, tuple[str, str], str, int]]:
    hub = "/devices/pci0000:00/0000:00:14.0/usb2"
    parts = [(serial, part) for serial in SERIALS for part in _PARTS]
    return [
        (hub, _HUB, "0000:00:14.0", 1),
        *((f"{hub}/2-{n}", part, serial, n + 1) for n, (serial, part) in enumerate(parts, 1)),
    ]


def _describe(path: str, numbers: tuple[str, str], serial: str, place: int) -> str:
    """A device with one configuration and one interface, in umockdev's own format."""
    vendor, product = (bytes.fromhex(number)[::-1].hex() for number in numbers)
    content = f"1201000300000009{vendor}{product}0001000003010902120001010080FA0904000000FF000000"
    attributes = {"busnum": "2", "devnum": str(place), "speed": "5000", "bConfigurationValue": "1", "serial": serial}
    attributes |= {"idVendor": numbers[0], "idProduct": numbers[1], "devpath": path.rpartition("-")[2][:3] or "0"}
    return "\n".join(
        [
            f"P: {path}",
            f"N: bus/usb/002/{place:03}={content.upper()}",
            f"E: DEVNAME=/dev/bus/usb/002/{place:03}",
            *("E: DEVTYPE=usb_device", "E: SUBSYSTEM=usb", "E: MAJOR=189", f"E: MINOR={127 + place}"),
            *("E: BUSNUM=002", f"E: DEVNUM={place:03}"),
            *(f"A: {name}={value}" for name, value in attributes.items()),
            f"H: descriptors={content.upper()}",
            "",
        ]
    )
