"""Discovers and opens attached cameras, cameras on the network, and recordings played by the SDK."""

from collections.abc import Callable
from typing import Any

from drivers.contract.address import with_name
from drivers.contract.device import AddressError, DeviceInfo, DeviceState, SdkMissingError
from drivers.contract.discovery import UDEV_REMEDY, Availability, Found, choose
from drivers.orbbec import library
from drivers.orbbec.address import Address, parse
from drivers.orbbec.device import OrbbecDevice, Origin
from drivers.orbbec.streams import wanted

#: Port of cameras on the network.
_PORT = 8090
_UNKNOWN = DeviceInfo("orbbec://", "Orbbec", "")


def discover(timeout_s: float) -> list[Found]:
    """Cameras attached by USB; never raises, and sends nothing to the network."""
    try:
        ob = library.load()
    except SdkMissingError as error:
        return [Found(_UNKNOWN, Availability.SDK_MISSING, error.reason, error.remedy)]
    try:
        context = library.context(ob)
        return [_found(info) for info in _attached(context)]
    except Exception as error:  # the SDK's exceptions have no common base
        return [Found(_UNKNOWN, Availability.FAULTY, f"Orbbec's SDK says: {error}")]


def open_device(uri: str, clock: Callable[[], int]) -> OrbbecDevice:
    """Opens `orbbec://SERIAL`, `orbbec://IP-ADDRESS`, or `orbbec://?recording=FILE.bag`, played by the SDK.

    Raises:
        AddressError: invalid address, or the file cannot be played.
        SdkMissingError: pyorbbecsdk2 is not installed.
        DeviceError: no such camera, or it lacks a requested stream.
    """
    address = parse(uri)
    ob = library.load()
    context = library.context(ob)
    if address.recording is not None:
        return of_origin(playback(ob, context, address), address, clock)
    if address.host:
        return of_origin(_on_network(ob, context, address), address, clock)
    return of_origin(_on_usb(ob, context, address), address, clock)


def of_origin(origin: Origin, address: Address, clock: Callable[[], int]) -> OrbbecDevice:
    """Device with those streams of a camera or recording that the address asks for.

    Raises:
        DeviceError: it lacks a requested stream, or its calibration is invalid.
    """
    with library.translated_errors(origin.info.uri):
        streams = wanted(origin.camera, address)
    return OrbbecDevice(origin, streams, clock)


def device_info(camera: Any, uri: str) -> DeviceInfo:
    """Identity of an open camera."""
    info = camera.get_device_info()
    name, serial, firmware = info.get_name(), info.get_serial_number(), info.get_firmware_version()
    return DeviceInfo(uri, name, serial, firmware, info.get_connection_type())


def playback(ob: Any, context: Any, address: Address) -> Origin:
    """A recording of the SDK, played by it.

    Raises:
        AddressError: it cannot be played.
    """
    try:
        camera = ob.PlaybackDevice(str(address.recording))
        info = device_info(camera, address.uri)
    except Exception as error:  # the SDK's exceptions have no common base
        raise AddressError(f"{address.uri}: {address.recording} cannot be played: {error}") from error

    def ended() -> tuple[DeviceState, str] | None:
        is_over = camera.get_playback_status() == ob.OBPlaybackStatus.STOPPED
        return (DeviceState.CLOSED, "the recording has ended") if is_over else None

    return Origin(ob, context, camera, info, ended, regular=False)


def _on_usb(ob: Any, context: Any, address: Address) -> Origin:
    serial = choose(discover(1.0), "orbbec", address.serial).info.serial
    with library.translated_errors(address.uri):
        camera = context.query_devices().get_device_by_serial_number(serial)
        info = device_info(camera, with_name(address.uri, serial))

    def ended() -> tuple[DeviceState, str] | None:
        try:
            is_there = any(one.serial == serial for one in _attached(context))
        except Exception:  # the SDK's exceptions have no common base
            is_there = False
        return None if is_there else (DeviceState.FAILED, "the camera is gone")

    return Origin(ob, context, camera, info, ended)


def _on_network(ob: Any, context: Any, address: Address) -> Origin:
    with library.translated_errors(address.uri):
        camera = context.create_net_device(address.host, _PORT)
        info = device_info(camera, address.uri)
    # Nothing tells that it is gone; a camera that falls silent is found by the age of its images.
    return Origin(ob, context, camera, info, lambda: None)


def _attached(context: Any) -> list[DeviceInfo]:
    """Identities of attached cameras, which are not opened."""
    devices = context.query_devices()
    found = []
    for number in range(devices.get_count()):
        serial = devices.get_device_serial_number_by_index(number)
        name = devices.get_device_name_by_index(number)
        link = devices.get_device_connection_type_by_index(number)
        found.append(DeviceInfo(f"orbbec://{serial}", name, serial, link=link))
    return found


def _found(info: DeviceInfo) -> Found:
    """A camera without a serial number is one whose descriptors may not be read."""
    if info.serial:
        return Found(info)
    return Found(info, Availability.NO_PERMISSION, "its serial number cannot be read", UDEV_REMEDY)
