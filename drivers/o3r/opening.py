"""Discovers and opens heads."""

import os
from collections.abc import Callable
from typing import Any

from drivers.contract.device import DeviceError, DeviceInfo, SdkMissingError
from drivers.contract.discovery import Availability, Found, choose
from drivers.o3r import library, live_message
from drivers.o3r.address import XMLRPC_PORT, Address, parse
from drivers.o3r.chunks import ChunkError
from drivers.o3r.device import O3rDevice
from drivers.o3r.head_link import HeadLink
from drivers.o3r.heads import Head, heads

_UNKNOWN = DeviceInfo("o3r://", "ifm O3R", "")


def discover(timeout_s: float) -> list[Found]:
    """Heads of the processing unit that the environment variable IFM3D_IP names, no others; never raises.

    Nothing is sent to a network that nobody has asked for.
    """
    try:
        ifm3d = library.load()
    except SdkMissingError as error:
        return [Found(_UNKNOWN, Availability.SDK_MISSING, error.reason, error.remedy)]
    host = os.environ.get("IFM3D_IP", "")
    try:
        return [found for _, found in _attached(_unit(ifm3d, Address(host)), "o3r://")] if host else []
    except DeviceError as error:
        return [Found(_UNKNOWN, Availability.FAULTY, str(error), f"IFM3D_IP is {host}: is the unit there?")]


def open_device(uri: str, clock: Callable[[], int]) -> O3rDevice:
    """Opens a head, such as `o3r://192.168.0.69?head=000000000281`, and takes its first image for the calibration.

    Raises:
        AddressError: invalid address.
        SdkMissingError: ifm3dpy is not installed.
        DeviceError: no such head, or no images from it.
    """
    address = parse(uri)
    ifm3d = library.load()
    unit = _unit(ifm3d, address)
    attached = _attached(unit, uri)
    info = choose([found for _, found in attached], "o3r", address.head).info
    (head,) = (head for head, found in attached if found.info is info)
    link = HeadLink(ifm3d, unit, head, uri)
    try:
        return O3rDevice(link, info, live_message.decoded(ifm3d, link.first()), clock)
    except ChunkError as error:
        raise DeviceError(f"{uri}: {error}") from error


def _unit(ifm3d: Any, address: Address) -> Any:
    return ifm3d.O3R(address.host or ifm3d.DEFAULT_IP, address.port)


def _attached(unit: Any, uri: str) -> list[tuple[Head, Found]]:
    with library.translated_errors(uri):
        configuration, firmware = unit.get(["/ports"]), str(unit.firmware_version())
    name = unit.ip if unit.xmlrpc_port == XMLRPC_PORT else f"{unit.ip}:{unit.xmlrpc_port}"
    return [(head, head.found(name, firmware)) for head in heads(configuration)]
