"""Luxonis OAK cameras, time-of-flight and stereo, through depthai; and depthai's recordings."""

from collections.abc import Callable

from drivers.contract.device import Device
from drivers.contract.discovery import Found
from drivers.oak.address import parse
from drivers.oak.device import OakDevice
from drivers.oak.images.recording import OakRecording
from drivers.oak.source import live, playback

__all__ = ["check_address", "discover", "open_device", "open_recording"]

check_address = parse
open_recording = OakRecording


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `oak://SERIAL`, or `oak://?recording=FOLDER`, played by depthai.

    Raises:
        AddressError: invalid address.
        SdkMissingError: depthai is not installed.
        DeviceError: no such device, or no images from it.
    """
    address = parse(uri)
    connection = live.connect(address) if address.recording is None else playback.connect(address, address.recording)
    return OakDevice(connection, clock)


def discover(timeout_s: float) -> list[Found]:
    """OAK devices on USB; on the network only if the environment variable DEPTHAI_PROTOCOL enables it."""
    return live.discover(timeout_s)
