"""Discovers Azure Kinects and opens one."""

import ctypes
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from drivers.azure import calibration, library
from drivers.azure.address import Address, parse
from drivers.azure.attached import MODEL, attached
from drivers.azure.calibration import CalibrationError
from drivers.azure.device import AzureDevice
from drivers.azure.kinect import Kinect
from drivers.contract.address import with_name
from drivers.contract.device import DeviceError, DeviceInfo, SdkMissingError
from drivers.contract.discovery import Availability, Found, choose

#: What the kernel tells of USB devices, and their nodes.
USB, NODES = Path("/sys/bus/usb/devices"), Path("/dev/bus/usb")
#: The SDK opens by numbers, and which camera has one is known only when it is open: one opens at a time.
_opening = threading.Lock()


def discover(timeout_s: float) -> list[Found]:
    """Attached cameras, as the kernel lists them; never raises and opens none."""
    try:
        library.load()
    except SdkMissingError as error:
        return [Found(DeviceInfo("azure://", MODEL, ""), Availability.SDK_MISSING, error.reason, error.remedy)]
    return attached(USB, NODES)


def open_device(uri: str, clock: Callable[[], int]) -> AzureDevice:
    """Opens `azure://SERIAL`, or `azure://` if one is attached.

    Raises:
        AddressError: invalid address.
        SdkMissingError: the SDK is not installed.
        DeviceError: no such camera, it cannot be opened, or its calibration is not understood.
    """
    address = parse(uri)
    sdk = library.load()
    found = choose(discover(1.0), "azure", address.serial).info
    kinect = _opened(sdk, uri, found.serial)
    try:
        return _device(kinect, address, found, clock)
    except Exception:
        kinect.close()
        raise


def _device(kinect: Kinect, address: Address, found: DeviceInfo, clock: Callable[[], int]) -> AzureDevice:
    info = replace(found, uri=with_name(address.uri, found.serial), firmware=kinect.firmware())
    modes = {head: mode for head, mode in (("depth", address.depth), ("color", address.color)) if mode}
    try:
        cameras = calibration.cameras(kinect.calibration(), modes)
    except CalibrationError as error:
        raise DeviceError(f"{address.uri}: {error}") from error
    return AzureDevice(kinect, address, info, cameras, clock)


def _opened(sdk: Any, uri: str, serial: str) -> Kinect:
    with _opening:
        library.forget()
        for kinect in _free(sdk, uri):
            try:
                if kinect.serial() == serial:
                    return kinect
            except DeviceError:  # one that breaks down is not the one, or the next attempt will tell
                pass
            kinect.close()
        raise DeviceError(f"{uri}: {serial} cannot be opened: {library.reason()}")


def _free(sdk: Any, uri: str) -> Iterator[Kinect]:
    """The cameras that can be opened, one after the other."""
    for number in range(sdk.k4a_device_get_installed_count()):
        handle = ctypes.c_void_p()
        if sdk.k4a_device_open(number, ctypes.byref(handle)) == 0:
            yield Kinect(sdk, handle, uri)
