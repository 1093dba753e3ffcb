"""Cameras that the driver finds: folders like those of the kernel, and the library with emulated cameras."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from drivers.azure import library, opening
from tests.drivers.azure.emulation import EmulatedKinect, EmulatedSdk


@contextmanager
def attached(folder: Path, *cameras: EmulatedKinect) -> Iterator[EmulatedSdk]:
    """Cameras that the driver finds: in a folder like /sys/bus/usb/devices, and in the library."""
    usb, nodes = usb_tree(folder, *(camera.serial for camera in cameras))
    sdk = EmulatedSdk(library.load(), *cameras)
    with (
        patch.object(library, "load", lambda: sdk),
        patch.object(opening, "USB", usb),
        patch.object(opening, "NODES", nodes),
    ):
        yield sdk


def usb_tree(folder: Path, *serials: str, driver: str = "uvcvideo") -> tuple[Path, Path]:
    """Folders like /sys/bus/usb/devices and /dev/bus/usb with the colour parts of some cameras."""
    (folder / "drivers" / driver).mkdir(parents=True)
    (folder / "nodes" / "002").mkdir(parents=True)
    for number, serial in enumerate(serials):
        entry = folder / "devices" / f"2-{number + 1}"
        (entry / f"{entry.name}:1.0").mkdir(parents=True)
        (entry / f"{entry.name}:1.0" / "driver").symlink_to(folder / "drivers" / driver)
        texts = {"idVendor": "045e", "idProduct": "097d", "serial": serial, "speed": "5000", "busnum": "2"}
        for name, text in (texts | {"devnum": str(number + 2)}).items():
            (entry / name).write_text(f"{text}\n", encoding="ascii")
        (folder / "nodes" / "002" / f"{number + 2:03}").touch()
    return folder / "devices", folder / "nodes"
