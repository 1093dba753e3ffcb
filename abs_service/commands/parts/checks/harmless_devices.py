"""Devices that touch no hardware, and the frame sets that they deliver within a few seconds."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from queue import Empty, SimpleQueue

from abs_service import config, wiring
from abs_service.commands.parts import rig_devices
from abs_service.commands.parts.options import OptionError
from abs_service.pairing.synchroniser import Synchroniser
from calib.rig import Rig
from drivers import opening
from drivers.contract.device import Device, DeviceState, Sink
from drivers.contract.frame import Frame, FrameSet

#: Drivers that touch no hardware, so that opening a device is the best check of its address.
HARMLESS = frozenset({"replay", "simulated"})

#: Duration of the exposures that are taken from a device [s].
TAKEN_S = 10.0

#: Time without a frame after which a device has ended [s]; the simulation compiles its kernels before the first one.
SILENCE_S = 60.0


@contextmanager
def opened(settings: config.ServiceConfig, tracker: str) -> Iterator[tuple[Rig, Iterator[FrameSet]]]:
    """The rig of a tracker and its frame sets, from opened devices; closes them.

    Raises:
        OptionError: one of the tracker's devices may be real hardware.
        DeviceError: a device cannot be opened or cannot stream.
        HeadError: the configuration names a head that its device does not have.
    """
    names = dict.fromkeys(settings.sensors[sensor].device for sensor in settings.trackers[tracker].sensors)
    for name in names:
        if (uri := settings.devices[name].uri).partition(":")[0] not in HARMLESS:
            raise OptionError(
                f"devices.{name} is {uri}, and only {' and '.join(sorted(HARMLESS))} devices are opened here; record "
                f"a few frames with `abs-service run --duration 2`, and take the picture with `abs-service replay`"
            )
    devices: dict[str, Device] = {}
    try:
        for name in names:
            devices[name] = opening.open_device(settings.devices[name].uri, time.monotonic_ns)
        known = [rig_devices.cameras(settings, name, device) for name, device in devices.items()]
        rig = wiring.rig(settings, tracker, wiring.cameras(settings, {k: v for part in known for k, v in part.items()}))
        yield rig, _frame_sets(settings, devices, wiring.synchroniser(settings, tracker, rig.sensors.values()))
    finally:
        for device in devices.values():
            device.close()


def _frame_sets(
    settings: config.ServiceConfig, devices: Mapping[str, Device], synchroniser: Synchroniser
) -> Iterator[FrameSet]:
    """Starts devices and yields their frame sets; ends with the devices, or after `TAKEN_S` of exposures."""
    arrived: SimpleQueue[Frame | None] = SimpleQueue()
    for name, device in devices.items():
        device.start(_Sink(settings.heads(name), arrived))
    streaming, begin_ns = len(devices), 0
    while streaming:
        try:
            frame = arrived.get(timeout=SILENCE_S)
        except Empty:
            break
        if frame is None:
            streaming -= 1
            continue
        begin_ns = begin_ns or frame.t_host_ns
        if frame.t_host_ns - begin_ns > TAKEN_S * 1e9:
            break
        yield from synchroniser.add(frame)
    yield from synchroniser.flush()


class _Sink(Sink):
    """Puts frames under their rig names into a queue, and None at the end."""

    def __init__(self, heads: Mapping[str, str], arrived: "SimpleQueue[Frame | None]") -> None:
        self._heads = heads
        self._arrived = arrived

    def on_frame(self, frame: Frame) -> None:
        if frame.sensor in self._heads:
            self._arrived.put(replace(frame, sensor=self._heads[frame.sensor]))

    def on_state(self, state: DeviceState, reason: str) -> None:
        if state.is_over:
            self._arrived.put(None)
