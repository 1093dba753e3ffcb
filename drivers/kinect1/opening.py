"""Discovers and opens cameras."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from drivers.contract.device import DeviceError
from drivers.contract.discovery import UDEV_REMEDY, Found, choose
from drivers.contract.errors import translated_sdk_errors
from drivers.kinect1.address import Address
from drivers.kinect1.device import Kinect1Device
from drivers.kinect1.transport.attached import BackendFactory, fresh_backend, list_attached
from drivers.kinect1.transport.port import Port, ReaderFactory
from drivers.kinect1.transport.ring import IsochronousRing


def find(backends: BackendFactory = fresh_backend) -> list[Found]:
    """All attached cameras."""
    return [one.found for one in list_attached(backends())]


def open_camera(
    address: Address,
    clock: Callable[[], int],
    backends: BackendFactory = fresh_backend,
    streaming: ReaderFactory = IsochronousRing,
) -> Kinect1Device:
    """Opens the camera of an address.

    Args:
        address: serial number and streams.
        clock: CLOCK_MONOTONIC [ns].
        backends: factory of pyusb backends.
        streaming: factory of isochronous readers.

    Raises:
        DeviceError: not attached, it cannot be opened, or USB cannot be searched; names the remedy.
    """
    with translated_sdk_errors(address.uri, UDEV_REMEDY):
        backend = backends()
        there_are = list_attached(backend)
    chosen = choose([one.found for one in there_are], "kinect1", address.serial)
    (device,) = [one.device for one in there_are if one.found is chosen]
    port = Port(device, backend, streaming, clock)
    try:
        # The URI reopens the same camera with the same streams.
        info = replace(chosen.info, uri=replace(address, serial=chosen.info.serial).uri)
        return Kinect1Device(info, address.streams, port, clock, time.sleep)
    except DeviceError:
        with suppress(DeviceError):
            port.close()
        raise
