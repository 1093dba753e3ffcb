"""Keeps a device delivering: opens it, starts it, and does both again when it fails."""

import logging
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace

from abs_service.health import Health, Level
from drivers.device import Device, DeviceError, DeviceState, FinalError, Sink, Truth
from drivers.frame import Frame

_log = logging.getLogger(__name__)

#: Pause before a failed device is opened again: doubles with each failure in a row, up to the longest [s].
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.5, 10.0
#: A device that says it streams and delivers nothing for this long is opened again [ns].
SILENCE_NS = 5_000_000_000

_LEVELS = {
    DeviceState.CLOSED: Level.OK,
    DeviceState.OPENING: Level.OK,
    DeviceState.STREAMING: Level.OK,
    DeviceState.STALLED: Level.WARNING,
    DeviceState.RECONNECTING: Level.ERROR,
    DeviceState.FAILED: Level.ERROR,
}


class DeviceKeeper:
    """Looks after one device from a thread of its own, because opening may take long.

    Args:
        name: name of the device in the configuration.
        open_device: opens it.
        on_open: told of each opened device before it starts; what it raises becomes `refusal` and ends the keeper.
        sink: where the frames go, under the names of the rig.
        heads: names in the rig of the device's heads; frames of others are not wanted.
        health: of the component.
        clock: CLOCK_MONOTONIC [ns].

    Attributes:
        finished: the device has come to its end by itself, as a recording does.
        refusal: why the device cannot be used at all; None if it can.
    """

    def __init__(
        self,
        name: str,
        open_device: Callable[[], Device],
        on_open: Callable[[Device], None],
        sink: Sink,
        heads: Mapping[str, str],
        health: Health,
        clock: Callable[[], int],
    ) -> None:
        self._name = name
        self._open_device = open_device
        self._on_open = on_open
        self._sink = sink
        self._heads = heads
        self._health = health
        self._clock = clock
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"device {name}", daemon=True)
        self._earlier: Counter[str] = Counter()  # what earlier openings of the device counted
        self.finished = False
        self.refusal: Exception | None = None

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def close(self, timeout_s: float) -> None:
        """Stops and closes the device; a driver that does not return is left behind after `timeout_s`."""
        self._stop.set()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        pause_s = FIRST_PAUSE_S
        while not self._stop.is_set():
            try:
                delivered, reason = self._serve_once()
            except FinalError as error:
                self.refusal = error
                delivered, reason = False, str(error)
            except DeviceError as error:
                delivered, reason = False, str(error)
            except Exception as error:
                # A driver's mistake must not take the other devices down.
                _log.exception("device %s", self._name)
                delivered, reason = False, repr(error)
            if self._stop.is_set() or self.finished or self.refusal:
                self._say(DeviceState.CLOSED, reason)
                return
            pause_s = FIRST_PAUSE_S if delivered else min(2 * pause_s, LONGEST_PAUSE_S)
            self._say(DeviceState.RECONNECTING, f"{reason}; trying again in {pause_s:g} s")
            self._health.count(f"device.{self._name}.reconnects")
            self._stop.wait(pause_s)

    def _serve_once(self) -> tuple[bool, str]:
        """Serves the device until it fails or shall stop; returns whether it delivered anything, and why it ended."""
        self._say(DeviceState.OPENING, "")
        device = self._open_device()
        # Grows with every opening, also across restarts of this process, and leaves the device ten epochs a second.
        watch = _Watch(self._sink, self._heads, self._clock, first_epoch=self._clock() // 100_000_000)
        try:
            try:
                self._on_open(device)
            except Exception as error:
                self.refusal = error
                return False, str(error)
            device.start(watch)
            reason = self._watch(device, watch)
        finally:
            device.close()
            self._earlier.update(device.counters)
            self._earlier["unwanted"] += watch.unwanted
        return watch.latest_ns > 0, reason

    def _watch(self, device: Device, watch: "_Watch") -> str:
        shown = (DeviceState.OPENING, "")
        while not self._stop.wait(0.1):
            counters = Counter({"unwanted": watch.unwanted, **device.counters})
            counters.update(self._earlier)
            self._health.count_up_to(counters, f"device.{self._name}.")
            state, reason = watch.state
            if (state, reason) != shown:
                shown = (state, reason)
                self._say(state, reason)
            if state == DeviceState.FAILED:
                return reason
            if state == DeviceState.CLOSED:
                self.finished = True
                return reason
            silent_ns = self._clock() - watch.latest_ns
            if state == DeviceState.STREAMING and watch.latest_ns and silent_ns > SILENCE_NS:
                return f"delivers nothing for {silent_ns / 1e9:.1f} s"
        return "stopped"

    def _say(self, state: DeviceState, reason: str) -> None:
        self._health.label(f"device.{self._name}", state.value)
        level = _LEVELS[state]
        self._health.report(f"device {self._name}", level, f"{self._name}: {reason}" if level > Level.OK else "")


class _Watch:
    """A sink that speaks the names of the rig and notes when something last came."""

    def __init__(self, sink: Sink, heads: Mapping[str, str], clock: Callable[[], int], first_epoch: int) -> None:
        self._sink = sink
        self._heads = heads
        self._clock = clock
        self._first_epoch = first_epoch
        self.latest_ns = 0
        self.unwanted = 0
        self.state = (DeviceState.OPENING, "")

    def on_frame(self, frame: Frame) -> None:
        self.latest_ns = self._clock()
        sensor = self._heads.get(frame.sensor)
        if sensor is None:
            self.unwanted += 1
            return
        self._sink.on_frame(replace(frame, sensor=sensor, epoch=self._first_epoch + frame.epoch))

    def on_truth(self, truth: Truth) -> None:
        self._sink.on_truth(truth)

    def on_state(self, state: DeviceState, reason: str) -> None:
        self.state = (state, reason)
        self._sink.on_state(state, reason)

    def on_warning(self, condition: str, message: str) -> None:
        self._sink.on_warning(condition, message)
