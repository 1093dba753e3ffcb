"""From an address to an opened camera."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from drivers.contract.device import DeviceError
from drivers.contract.discovery import Found, choose
from drivers.kinect1.address import Address
from drivers.kinect1.device import Kinect1Device
from drivers.kinect1.transport.attached import BackendFactory, fresh_backend, list_attached
from drivers.kinect1.transport.port import Port, ReaderFactory
from drivers.kinect1.transport.ring import IsochronousRing


def find(backends: BackendFactory = fresh_backend) -> list[Found]:
    """All cameras that are attached."""
    return [one.found for one in list_attached(backends())]


def open_camera(
    address: Address,
    clock: Callable[[], int],
    backends: BackendFactory = fresh_backend,
    streaming: ReaderFactory = IsochronousRing,
) -> Kinect1Device:
    """Opens the camera that an address means.

    Args:
        address: which, and what it shall deliver.
        clock: CLOCK_MONOTONIC [ns].
        backends: makes what pyusb looks at the bus with.
        streaming: makes readers of isochronous pipes.

    Raises:
        DeviceError: none is attached, or it cannot be opened; says what to do.
    """
    backend = backends()
    there_are = list_attached(backend)
    chosen = choose([one.found for one in there_are], "kinect1", address.serial)
    (device,) = [one.device for one in there_are if one.found is chosen]
    port = Port(device, backend, streaming, clock)
    try:
        # The same streams when it is opened again after a loss, and the same camera.
        info = replace(chosen.info, uri=replace(address, serial=chosen.info.serial).uri)
        return Kinect1Device(info, address.streams, port, clock, time.sleep)
    except DeviceError:
        with suppress(DeviceError):
            port.close()
        raise
