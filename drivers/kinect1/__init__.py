"""The Xbox 360 Kinect and the Kinect for Windows, first generation, over USB without an SDK.

Codec: `packets`, `assembly`, `unpacking`, `reference_plane`. Protocol: `commands`, `camera`. Transport: `attached`,
`port`, `ring`. pyusb is imported only when a camera is looked for.
"""

from collections.abc import Callable

from drivers.contract.device import Device, DeviceInfo, SdkMissingError
from drivers.contract.discovery import Availability, Found
from drivers.kinect1.address import parse


def open_device(uri: str, clock: Callable[[], int]) -> Device:
    """Opens an address such as `kinect1://`, `kinect1://A00363A01234040A` or `kinect1://?streams=depth,ir`.

    Raises:
        AddressError: the address is not understood.
        SdkMissingError: pyusb is not installed.
        DeviceError: the camera cannot be opened; says what to do.
    """
    address = parse(uri)
    try:
        from drivers.kinect1 import opening  # noqa: PLC0415
    except ImportError as error:
        raise SdkMissingError("pyusb", "kinect") from error
    return opening.open_camera(address, clock)


def discover(timeout_s: float) -> list[Found]:
    """The cameras that are attached, and why one cannot be opened. Never raises."""
    try:
        from drivers.kinect1 import opening  # noqa: PLC0415
    except ImportError:
        missing = SdkMissingError("pyusb", "kinect")
        return [Found(_UNKNOWN, Availability.SDK_MISSING, missing.reason, missing.remedy)]
    try:
        return opening.find()
    except Exception as error:
        return [Found(_UNKNOWN, Availability.FAULTY, f"USB cannot be searched: {error}", "")]


_UNKNOWN = DeviceInfo(uri="kinect1://", model="Kinect v1", serial="")
