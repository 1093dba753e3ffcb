"""Luxonis OAK cameras, time-of-flight and stereo, through depthai; and what depthai recorded."""

from collections.abc import Callable

from drivers.contract.device import Device
from drivers.contract.discovery import Found
from drivers.oak import live, playback
from drivers.oak.address import parse
from drivers.oak.device import OakDevice
from drivers.oak.recording import OakRecording

__all__ = ["discover", "open_device", "open_recording"]

open_recording = OakRecording


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens `oak://SERIAL`, or `oak://?recording=FOLDER`, which depthai plays.

    Raises:
        AddressError: the address is not understood.
        SdkMissingError: depthai is not installed.
        DeviceError: there is no such device, or it does not deliver.
    """
    address = parse(uri)
    connection = live.connect(address) if address.recording is None else playback.connect(address, address.recording)
    return OakDevice(connection, clock)


def discover(timeout_s: float) -> list[Found]:
    """The OAK devices on USB; on the network only if the environment variable DEPTHAI_PROTOCOL says so."""
    return live.discover(timeout_s)
