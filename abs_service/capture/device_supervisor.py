"""Opens and starts a device, and reopens it when it fails or stalls.

Drivers do not reconnect: retries, backoff, the expected serial number and the epoch are decided here.
"""

import logging
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from typing import TypeVar

from abs_service.bus.health import Health, Level
from abs_service.capture.image_check import RepeatedImages
from abs_service.capture.stall_detector import StallDetector
from drivers.contract.device import Device, DeviceError, DeviceState, FinalError, Sink

_T = TypeVar("_T")
_log = logging.getLogger(__name__)

#: Backoff before a failed device is reopened: doubles with each consecutive failure, up to the longest [s].
FIRST_BACKOFF_S, MAX_BACKOFF_S = 0.5, 10.0
#: Longest wait for the end of a command, before another one or before the device is closed all the same [s].
COMMAND_S = 1.0
#: A driver that has not returned for longer hangs; some take long to open a device [s].
HANG_S = 30.0

_LEVELS = {
    DeviceState.CLOSED: Level.OK,
    DeviceState.OPENING: Level.OK,
    DeviceState.STREAMING: Level.OK,
    DeviceState.STALLED: Level.WARNING,
    DeviceState.RECONNECTING: Level.ERROR,
    DeviceState.FAILED: Level.ERROR,
    DeviceState.BROKEN: Level.ERROR,
}


class DeviceSupervisor:
    """Supervises one device from a thread of its own, because opening may take long.

    Args:
        name: name of the device in the configuration.
        uri: its address. After the first opening, only the same serial number is accepted.
        open_device: opens the device at an address.
        on_open: called with each opened device before it starts. A `DeviceError` that is not final is retried; any
            other exception becomes `fatal_error` and ends the supervisor.
        sink: receives the frames, with the sensor names of the rig.
        heads: sensor names by head of the device; frames of other heads are dropped.
        health: of the component.
        clock: CLOCK_MONOTONIC [ns].

    Attributes:
        finished: the device has ended by itself, as a recording does.
        fatal_error: the error after which no retry helps; None if there is none.
    """

    def __init__(
        self,
        name: str,
        uri: str,
        open_device: Callable[[str], Device],
        on_open: Callable[[Device], None],
        sink: Sink,
        heads: Mapping[str, str],
        health: Health,
        clock: Callable[[], int],
    ) -> None:
        self._name = name
        self._uri = uri
        self._serial = ""
        self._open_device = open_device
        self._on_open = on_open
        self._sink = sink
        self._heads = heads
        self._health = health
        self._clock = clock
        self._device: Device | None = None  # while it streams
        self._lock = threading.Lock()  # of commands to the device
        self._returned_ns = clock()  # when the driver was last seen to return
        self._stop = threading.Event()
        self._abandoned = False
        self._thread = threading.Thread(target=self._run, name=f"device {name}", daemon=True)
        self._failure = ""  # for which it was opened again, until all its streams deliver
        self._previous: Counter[str] = Counter()  # counters of earlier openings
        self._repeated_images = RepeatedImages()
        self.finished = False
        self.fatal_error: Exception | None = None

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Begins to close the device, and returns at once."""
        self._stop.set()

    def close(self, timeout_s: float) -> None:
        """Stops and closes the device; a driver that does not return within `timeout_s` is abandoned."""
        self.stop()
        self._thread.join(timeout_s)
        self._abandoned = self._thread.is_alive()

    def use(self, act: Callable[[Device], _T]) -> _T:
        """Calls `act` with the device and returns its result; the device is not closed for a second meanwhile.

        Raises:
            DeviceError: the device is not open, hangs in a command before this one, or whatever `act` raises.
        """
        lock = self._lock
        if not lock.acquire(timeout=COMMAND_S):
            raise DeviceError(f"{self._name} has not returned from the command before this one")
        try:
            if self._device is None or lock is not self._lock:
                raise DeviceError(f"{self._name} is not open at present")
            return act(self._device)
        finally:
            lock.release()

    def check(self) -> None:
        """Reports a driver that hangs: only a new process helps, which would interrupt other devices, too."""
        # As for want of memory. Nobody would open the device again.
        if not (self._thread.is_alive() or self.finished or self.fatal_error or self._stop.is_set()):
            self.fatal_error = RuntimeError(f"{self._name} is not supervised any more: its thread has ended")
        silent_s = (self._clock() - self._returned_ns) * 1e-9
        hangs = silent_s > HANG_S and not (self.finished or self.fatal_error)
        remedy = f"its driver has not returned for {silent_s:.0f} s; end `capture`, which `run` starts again"
        message = f"{self._name}: {remedy}" if hangs else ""
        self._health.report(f"driver of {self._name}", Level.ERROR if hangs else Level.OK, message)

    def _run(self) -> None:
        backoff_s = FIRST_BACKOFF_S
        while not self._stop.is_set():
            self._returned_ns = self._clock()
            try:
                delivered, reason = self._run_once()
            except FinalError as error:
                self.fatal_error = error
                delivered, reason = False, str(error)
            except DeviceError as error:
                delivered, reason = False, str(error)
            except Exception as error:
                # A bug in a driver must not stop the other devices.
                _log.exception("device %s", self._name)
                delivered, reason = False, repr(error)
            if self._stop.is_set() or self.finished or self.fatal_error:
                self._report_state(DeviceState.CLOSED, reason)
                return
            backoff_s = FIRST_BACKOFF_S if delivered else min(2 * backoff_s, MAX_BACKOFF_S)
            self._failure = reason
            self._report_state(DeviceState.RECONNECTING, f"{reason}; trying again in {backoff_s:g} s")
            self._health.count(f"device.{self._name}.reconnects")
            self._stop.wait(backoff_s)

    def _run_once(self) -> tuple[bool, str]:
        """Runs the device until it fails or is stopped; returns True if it delivered, and why it ended."""
        self._report_state(DeviceState.OPENING, "")
        device = self._open_device(self._uri)
        streams = device.capabilities.streams if device.capabilities.regular else ()
        # Grows with every opening, also across restarts of this process, and leaves the device ten epochs a second.
        first_epoch = self._clock() // 100_000_000
        stall_detector = StallDetector(
            self._sink, self._heads, streams, self._clock, first_epoch, self._repeated_images
        )
        try:
            self._check_serial(device)
            if self._stop.is_set():
                return False, "stopped"  # while it was opened; the bus may be closed by now
            try:
                self._on_open(device)
            except DeviceError:
                raise
            except Exception as error:
                if not self._abandoned:
                    self.fatal_error = error
                return False, str(error)
            device.start(stall_detector)
            self._device = device
            reason = self._watch(device, stall_detector)
        finally:
            self._withdraw()
            device.close()
            self._health.withdraw(f"device {self._name} ")  # its warnings; opened again, it tells them again
            self._previous.update(device.counters)
            self._previous.update(stall_detector.counters)
            self._health.count_up_to(self._previous, f"device.{self._name}.")
        return stall_detector.delivered, reason

    def _withdraw(self) -> None:
        """Takes the device from commands; one that hangs in it keeps its lock, and the next device gets another."""
        lock = self._lock
        is_free = lock.acquire(timeout=COMMAND_S)
        self._device, self._lock = None, threading.Lock()
        if is_free:
            lock.release()
        else:
            _log.warning("device %s: a command has not returned; it is closed all the same", self._name)

    def _check_serial(self, device: Device) -> None:
        """Checks the serial number against that of the first opening."""
        info = device.info
        if self._serial not in {"", info.serial}:
            raise DeviceError(f"{self._uri} is device {info.serial} now; {self._serial} is awaited, plug that one in")
        if info.serial:
            self._uri, self._serial = info.uri, info.serial

    def _watch(self, device: Device, stall_detector: StallDetector) -> str:
        shown = (DeviceState.OPENING, "", self._failure)
        while not self._stop.wait(0.1):
            self._measure(device, stall_detector)
            self._returned_ns = self._clock()
            state, reason = stall_detector.check()
            if state != shown[0]:
                self._health.count(f"device.{self._name}.stalls", int(state == DeviceState.STALLED))
            if state == DeviceState.STREAMING and stall_detector.all_delivered:
                self._failure = ""
            if (state, reason, self._failure) != shown:
                shown = (state, reason, self._failure)
                self._report_state(state, reason)
            if state == DeviceState.BROKEN:
                raise FinalError(reason)
            if state == DeviceState.FAILED:
                return reason
            if state == DeviceState.CLOSED:
                self.finished = True
                return reason
        return "stopped"

    def _measure(self, device: Device, stall_detector: StallDetector) -> None:
        counters = Counter(self._previous)
        counters.update(stall_detector.counters)
        counters.update(device.counters)
        self._health.count_up_to(counters, f"device.{self._name}.")
        for name, value in device.gauges.items():
            self._health.gauge(f"device.{self._name}.{name}", value)
        for condition, message in stall_detector.take_warnings().items():
            text = f"{self._name}: {message}" if message else ""
            self._health.report(f"device {self._name} {condition}", Level.WARNING if message else Level.OK, text)

    def _report_state(self, state: DeviceState, reason: str) -> None:
        if self._abandoned:
            return
        _log.info("device %s: %s %s", self._name, state.value, reason, extra={"fields": {"device": self._name}})
        self._health.label(f"device.{self._name}", state.value)
        level = _LEVELS[state]
        if self._failure and state != DeviceState.CLOSED:
            # A camera that can be opened is not yet one that delivers.
            reason = reason if level > Level.OK else f"{self._failure}; opened again, waits for its images"
            level = Level.ERROR
        self._health.report(f"device {self._name}", level, f"{self._name}: {reason}" if level > Level.OK else "")
