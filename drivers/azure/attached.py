"""Attached Azure Kinects by what the kernel tells of USB devices, without opening one.

The SDK (src/color/uvc_camerareader.cpp) finds a camera's colour part by the serial number that its depth part tells, so
the serial number of the colour part is that of the camera.
"""

import os
from pathlib import Path

from drivers.contract.device import DeviceInfo
from drivers.contract.discovery import UDEV_REMEDY, Availability, Found

MODEL = "Azure Kinect DK"
#: USB numbers of the colour part. It and the depth part are there on USB 3 only.
_COLOR_PART = ("045e", "097d")


def attached(usb: Path, nodes: Path) -> list[Found]:
    """The cameras in folders like /sys/bus/usb/devices and /dev/bus/usb."""
    entries = sorted(usb.iterdir()) if usb.is_dir() else []
    parts = [entry for entry in entries if (_text(entry, "idVendor"), _text(entry, "idProduct")) == _COLOR_PART]
    return [_found(entry, nodes) for entry in parts]


def _found(entry: Path, nodes: Path) -> Found:
    serial, speed = _text(entry, "serial"), _text(entry, "speed")
    info = DeviceInfo(f"azure://{serial}", MODEL, serial, link=f"USB, {speed} Mbit/s" if speed else "")
    if any((part / "driver").resolve().name == "usbfs" for part in entry.glob(f"{entry.name}:*")):
        return Found(info, Availability.BUSY, "a program uses it")
    node = nodes / _text(entry, "busnum").zfill(3) / _text(entry, "devnum").zfill(3)
    if not os.access(node, os.R_OK | os.W_OK):
        return Found(info, Availability.NO_PERMISSION, f"{node} may not be opened", UDEV_REMEDY)
    return Found(info)


def _text(entry: Path, name: str) -> str:
    try:
        return (entry / name).read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""
