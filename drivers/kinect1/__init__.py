"""Kinect for Xbox 360 and first-generation Kinect for Windows, over USB without an SDK.

Codec: `packets`, `assembly`, `unpacking`, `reference_plane`. Protocol: `commands`, `camera`. Transport: `attached`,
`port`, `ring`. pyusb is imported lazily.
"""

from collections.abc import Callable

from drivers.contract.device import Device, DeviceInfo, SdkMissingError
from drivers.contract.discovery import Availability, Found
from drivers.kinect1.address import parse

check_address = parse


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens an address such as `kinect1://`, `kinect1://A00363A01234040A` or `kinect1://?streams=depth,ir`.

    Raises:
        AddressError: invalid address.
        SdkMissingError: pyusb is not installed.
        DeviceError: the camera cannot be opened; names the remedy.
    """
    address = parse(uri)
    try:
        from drivers.kinect1 import opening  # noqa: PLC0415
    except ImportError as error:
        raise SdkMissingError("pyusb", "kinect", error=error) from error
    return opening.open_camera(address, clock)


def discover(timeout_s: float) -> list[Found]:
    """Attached cameras, and obstacles to opening them. Never raises."""
    try:
        from drivers.kinect1 import opening  # noqa: PLC0415
    except ImportError as error:
        missing = SdkMissingError("pyusb", "kinect", error=error)
        return [Found(_UNKNOWN, Availability.SDK_MISSING, missing.reason, missing.remedy)]
    try:
        return opening.find()
    except Exception as error:
        return [Found(_UNKNOWN, Availability.FAULTY, f"USB cannot be searched: {error}", "")]


_UNKNOWN = DeviceInfo(uri="kinect1://", model="Kinect v1", serial="")
