"""Emulated cameras on an emulated USB for unmodified programs: umockdev around the program, a server process behind it.

  python -m evaluation.service.kinect1_emulation.testbed PROGRAM…    runs a program under umockdev

The program starts the server (`Server`), for only it knows where umockdev has put its files.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from evaluation.service.kinect1_emulation import usb_descriptors

SERIALS = ("A00363A01234040A", "A00363A05678041A")

#: Where the cameras are: /dev/bus/usb/001/…, and their names below /sys/bus/usb/devices.
NUMBERS, NAMES = ("002", "003"), ("1-1", "1-2")

_ROOT_HUB = (
    "12010002090001406B1D020012050302010109021900010100E0000904000001090000000705810304000C",
    "1d6b",
    "0002",
    "0000:00:14.0",
)


def why_not() -> str:
    """Reason why the testbed is unavailable; "" if it is available."""
    return "" if shutil.which("umockdev-run") else "umockdev-run is not installed: apt install umockdev"


def run(program: Sequence[str], timeout_s: float = 120.0, cameras: int = 1) -> subprocess.CompletedProcess[str]:
    """Runs a program that sees so many cameras."""
    with tempfile.NamedTemporaryFile("w", suffix=".umockdev") as file:
        file.write(describe(cameras))
        file.flush()
        return subprocess.run(
            ["umockdev-run", "-d", file.name, "--", *program],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )


def describe(cameras: int) -> str:
    """Description of cameras in umockdev's own format."""
    device, configuration = usb_descriptors.device(0x02AE), usb_descriptors.configuration()
    content = (device + configuration).hex().upper()
    parts = [
        _describe(f"/devices/pci0000:00/0000:00:14.0/usb1/{name}", f"001/{number}", content, "045e", "02ae", serial)
        for name, number, serial in list(zip(NAMES, NUMBERS, SERIALS))[:cameras]
    ]
    hub, vendor, product, serial = _ROOT_HUB
    parts.append(_describe("/devices/pci0000:00/0000:00:14.0/usb1", "001/001", hub, vendor, product, serial))
    return "\n".join(parts)


def _describe(path: str, place: str, content: str, vendor: str, product: str, serial: str) -> str:
    number = int(place.partition("/")[2])
    attributes = {
        "bConfigurationValue": "1",
        "bNumConfigurations": "1",
        "busnum": "1",
        "devnum": str(number),
        "devpath": path.rpartition("-")[2] if "-" in path.rpartition("/")[2] else "0",
        "idVendor": vendor,
        "idProduct": product,
        "serial": serial,
        "speed": "480",
    }
    return "\n".join(
        [
            f"P: {path}",
            f"N: bus/usb/{place}={content}",
            f"E: DEVNAME=/dev/bus/usb/{place}",
            "E: DEVTYPE=usb_device",
            "E: SUBSYSTEM=usb",
            "E: MAJOR=189",
            f"E: MINOR={number - 1}",
            "E: BUSNUM=001",
            f"E: DEVNUM={place.partition('/')[2]}",
            *(f"A: {name}={value}" for name, value in attributes.items()),
            f"H: descriptors={content}",
            "",
        ]
    )


class Server:
    """The process `evaluation.service.kinect1_emulation.server`: the cameras of the testbed in which this one runs."""

    def __init__(self, *arguments: str) -> None:
        self.root = Path(os.environ["UMOCKDEV_DIR"])
        self._process = subprocess.Popen(
            [sys.executable, "-m", "evaluation.service.kinect1_emulation.server", str(self.root), *arguments],
            # Without umockdev's library the server sees its files as they are, and costs less.
            env={name: value for name, value in os.environ.items() if name != "LD_PRELOAD"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._listen()

    def send(self, command: str) -> str:
        """Sends a command to `evaluation.service.kinect1_emulation.server`; returns its answer."""
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()
        return self._listen()

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def _listen(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "the server has ended"
        return line.strip()


if __name__ == "__main__":
    done = run(sys.argv[1:])
    print(done.stdout, done.stderr)
    sys.exit(done.returncode)
