"""Attached OAKs: discovery, opening, and start of the pipeline for an address."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from drivers.contract.address import with_name
from drivers.contract.capabilities import SyncRole
from drivers.contract.clock import DeviceClock
from drivers.contract.device import DeviceError, DeviceInfo, SdkMissingError
from drivers.contract.discovery import UDEV_REMEDY, Availability, Found, choose
from drivers.oak import eeprom, library
from drivers.oak.address import Address
from drivers.oak.eeprom import EepromError
from drivers.oak.images.messages import OutputQueue
from drivers.oak.range_profile import RangeProfile
from drivers.oak.source.connection import CLOCK, Connection, synchronised
from drivers.oak.source.controls import make
from drivers.oak.source.pipelines import build

#: Depth of the image queues; the newest images are kept.
_QUEUE = 4
#: Polling interval of the temperature [s].
TEMPERATURE_S = 5.0
#: Models as far as they are known without opening the device: by the platform that answers.
_PLATFORMS = {"X_LINK_MYRIAD_X": "OAK (RVC2)", "X_LINK_RVC3": "OAK (RVC3)", "X_LINK_RVC4": "OAK (RVC4)"}
_LINKS = {"SUPER_PLUS": "USB 3, 10 Gbit/s", "SUPER": "USB 3, 5 Gbit/s", "HIGH": "USB 2, 480 Mbit/s"}


def discover(timeout_s: float, network: bool = False) -> list[Found]:
    """Devices on USB and, if `network`, on the network; never raises."""
    try:
        dai = library.load(network, search_ms=max(round(timeout_s * 1000), 1))
    except SdkMissingError as error:
        return [Found(DeviceInfo("oak://", "OAK", ""), Availability.SDK_MISSING, error.reason, error.remedy)]
    try:
        return [_found(dai, info) for info in dai.Device.getAllConnectedDevices()]
    except RuntimeError:  # without USB and without network there is nothing to search
        return []


def connect(address: Address) -> Connection:
    """Opens the device and starts its pipeline.

    Raises:
        SdkMissingError: depthai is not installed.
        DeviceError: no such device, or it lacks a requested camera.
    """
    dai = library.load(address.network)
    # Without a name, the only device; a named one is found by depthai, on the network as well.
    name = address.name or choose(discover(library.SEARCH_MS / 1000, address.network), "oak", "").info.serial
    with library.translated_errors(address.uri):
        device = dai.Device(dai.DeviceInfo(name))
    try:
        with library.translated_errors(address.uri):
            return _run(dai, device, address)
    except DeviceError:
        device.close()
        raise


def _run(dai: Any, device: Any, address: Address) -> Connection:
    # The device supervisor reopens a lost device; depthai's own reconnection would leave the queues silent.
    device.setMaxReconnectionAttempts(0)
    if address.sync != "free":
        done, reason = device.setExternalFrameSyncRole(getattr(dai.ExternalFrameSyncRole, address.sync.upper()))
        if not done:
            raise DeviceError(f"{address.uri}: sync = {address.sync}: {reason}")
    try:
        poses = eeprom.parse(json.dumps(device.readCalibration().eepromToJson()))
    except EepromError as error:
        raise DeviceError(f"{address.uri}: {error}") from error
    pipeline = dai.Pipeline(device)
    outputs = build(dai, device, pipeline, address)
    queues = {
        role: OutputQueue(output.createOutputQueue(maxSize=_QUEUE, blocking=False), outputs.views.get(role))
        for role, output in outputs.streams.items()
    }
    profile = RangeProfile(address.range, time.monotonic_ns)
    controls = make(dai, device, outputs, address, profile)
    pipeline.start()

    def close() -> None:
        pipeline.stop()
        device.close()

    return Connection(
        info=_info(device, address),
        queues=queues,
        poses=replace(poses, pair=poses.pair or outputs.pair),
        rate_hz=address.fps,
        close=close,
        host_times=lambda: DeviceClock(CLOCK),
        filters=outputs.filters,
        modulation=lambda role, t_host_ns: profile.at(t_host_ns) if role.sensor == "tof" else "",
        stamp=synchronised,
        controls=controls,
        sync_roles=(SyncRole.FREE, SyncRole.MASTER, SyncRole.SLAVE),
        gauges=Thermometer(device),
    )


def _info(device: Any, address: Address) -> DeviceInfo:
    serial = device.getDeviceId()
    link = _LINKS.get(device.getUsbSpeed().name, "") if device.getDeviceInfo().protocol.name == "X_LINK_USB_VSC" else ""
    # A device on the network keeps its address, since discovery does not search the network.
    name = address.name if address.network and address.name else serial
    uri = with_name(address.uri, name)
    return DeviceInfo(uri, str(device.getProductName() or device.getDeviceName()), serial, link=link)


class Thermometer:
    """The chip's temperature, cached, because every query is a transfer to the device.

    Args:
        device: `dai.Device`.
        clock: [s].
    """

    def __init__(self, device: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self._device = device
        self._clock = clock
        self._next_s = 0.0
        self._latest: Mapping[str, float] = {}

    def __call__(self) -> Mapping[str, float]:
        """`temperature_c` [°C]; empty if it cannot be read."""
        if self._clock() >= self._next_s:
            self._next_s = self._clock() + TEMPERATURE_S
            try:
                self._latest = {"temperature_c": float(self._device.getChipTemperature().average)}
            except Exception:  # loss of the device is detected elsewhere
                self._latest = {}
        return self._latest


def _found(dai: Any, info: Any) -> Found:
    serial = info.deviceId
    link = "network" if info.protocol == dai.XLinkProtocol.X_LINK_TCP_IP else "USB, speed known once opened"
    who = DeviceInfo(f"oak://{serial}", _PLATFORMS.get(info.platform.name, "OAK"), serial, link=link)
    if info.status == dai.XLinkError_t.X_LINK_INSUFFICIENT_PERMISSIONS:
        return Found(who, Availability.NO_PERMISSION, "this user may not open it", UDEV_REMEDY)
    if info.state == dai.XLinkDeviceState.X_LINK_BOOTED:
        return Found(who, Availability.BUSY, "another program uses it", "end that program")
    return Found(who)
