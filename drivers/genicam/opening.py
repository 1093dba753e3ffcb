"""Discovers and opens cameras."""

import time
from collections.abc import Callable
from dataclasses import replace

from drivers.contract.address import with_name
from drivers.contract.device import DeviceError, DeviceInfo, SdkMissingError
from drivers.contract.discovery import Availability, Found
from drivers.contract.errors import translated_sdk_errors
from drivers.genicam import features, library
from drivers.genicam.address import Address, parse
from drivers.genicam.device import First, GenicamDevice
from drivers.genicam.link import CameraLink, Shot
from drivers.genicam.pixels import PixelError

#: Longest search for cameras, and wait for the first image [s].
_SEARCH_S, _FIRST_S = 1.0, 5.0
#: Rate of a camera that does not report one [Hz].
_RATE_HZ = 10.0

_UNKNOWN = DeviceInfo("genicam://", "GenICam", "")


def discover(timeout_s: float) -> list[Found]:
    """Cameras of the producers that the environment variable names, which search their networks; never raises."""
    try:
        return library.producers().found(timeout_s)
    except SdkMissingError as error:
        return [Found(_UNKNOWN, Availability.SDK_MISSING, error.reason, error.remedy)]
    except Exception as error:  # exceptions of GenTL have no base that could be named without the library
        return [Found(_UNKNOWN, Availability.FAULTY, f"harvesters says: {error}", f"is {library.VARIABLE} right?")]


def open_device(uri: str, clock: Callable[[], int]) -> GenicamDevice:
    """Opens a camera, such as `genicam://24551234`, and takes its first image, from which its streams follow.

    Raises:
        AddressError: invalid address.
        SdkMissingError: harvesters is not installed.
        DeviceError: no such camera, no images from it, or none that can be used.
    """
    address = parse(uri)
    core, producers = library.load(), library.producers()
    if not library.files():
        raise DeviceError(
            f"{uri}: {library.VARIABLE} names no folder with a GenTL producer (*.cti); the camera's maker has one"
        )
    with translated_sdk_errors(uri, "another program may use the camera"):
        acquirer, info = producers.open(address.serial, _SEARCH_S)
    link = CameraLink(core, acquirer, uri)
    try:
        return of_link(link, info, address, clock)
    except BaseException:
        link.close()
        raise


def of_link(link: CameraLink, info: DeviceInfo, address: Address, clock: Callable[[], int]) -> GenicamDevice:
    """Device for a camera that is open.

    Raises:
        DeviceError: no images from it, or none that can be used.
    """
    with link.translated_errors():
        nodes = link.nodes
        features.configure(nodes, address)
        link.start()
        try:
            shot = _first(link)
            distances = features.distances(nodes, link.uri)  # chunks are there until it stops
        finally:
            link.stop()
        depth = next((part for part in shot.parts if part.pixel_format.startswith("Coord3D_")), None)
        if depth is None:
            raise DeviceError(f"{link.uri}: it sends no distances, but {[part.pixel_format for part in shot.parts]}")
        camera = features.camera(nodes, depth.width, depth.height, address)
        rate_hz = features.value(nodes, "AcquisitionFrameRate") or _RATE_HZ
        firmware = features.value(nodes, "DeviceFirmwareVersion", "DeviceVersion") or ""
    known = replace(info, uri=with_name(address.uri, info.serial), firmware=str(firmware))
    try:
        return GenicamDevice(link, known, First(shot, distances, camera, float(rate_hz)), clock)
    except PixelError as error:
        raise DeviceError(f"{link.uri}: {error}") from error


def _first(link: CameraLink) -> Shot:
    until = time.monotonic() + _FIRST_S
    while time.monotonic() < until:
        shot = link.take()
        if shot is not None:
            return shot
        time.sleep(0.002)
    raise DeviceError(f"{link.uri}: no image has come for {_FIRST_S:g} s")
