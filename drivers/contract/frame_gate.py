"""Gate between a driver's threads and the sink: validates frames, counts drops, and keeps state and epoch.

Every driver has one; it implements the contract's guarantees about counters, states and the end of delivery.
"""

import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from drivers.contract.capabilities import StreamInfo
from drivers.contract.clock import Stamp
from drivers.contract.device import DeviceError, DeviceState, Sink, Truth
from drivers.contract.frame import Frame

#: Latest frames of a stream that are judged, and number of unfit ones among them that is reported.
LATEST, MANY = 30, 15


class FrameGate:
    """Passes frames and states of one device to its sink. Thread-safe.

    Args:
        streams: declared streams; a frame that does not match them is dropped and counted.
        causes: the driver's own reasons for drops; their counters exist from the start.
    """

    def __init__(self, streams: Iterable[StreamInfo], causes: Iterable[str] = ()) -> None:
        self._streams = {stream.key: stream for stream in streams}
        self._unfit = {key: deque[bool](maxlen=LATEST) for key in self._streams}
        self._warned: set[str] = set()
        self._counters = Counter({"frames": 0, **dict.fromkeys(causes, 0)})
        # Reentrant, because the sink may stop the device in `on_frame`.
        self._lock = threading.RLock()
        self._sink: Sink | None = None
        self._state = DeviceState.CLOSED
        self._ended = threading.Event()
        self._released = False
        self._epoch = -1

    @property
    def state(self) -> DeviceState:
        """The state that was reported last."""
        return self._state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered, and drops by cause."""
        with self._lock:
            return dict(self._counters)

    @property
    def epoch(self) -> int:
        """Current epoch; 0 after the first start."""
        return self._epoch

    def begin(self, sink: Sink, reason: str) -> threading.Event | None:
        """Opens the gate with a new epoch in the state OPENING; None, without effect, if it is open already.

        Returns:
            Stop event of the driver's thread, set when delivery ends.

        Raises:
            DeviceError: the device was closed.
        """
        with self._lock:
            if self._released:
                raise DeviceError("the device was closed; it has to be opened anew")
            if self._sink is not None and not self._state.is_over:
                return None
            self._sink = sink
            self._epoch += 1
            self._ended.set()  # one thread of the last run may have failed, and others not
            self._ended = ended = threading.Event()
            self.report_state(DeviceState.OPENING, reason)
            return ended

    def end(self, reason: str) -> None:
        """Reports CLOSED, unless an end was reported already; nothing is delivered after it returns."""
        with self._lock:
            if not self._state.is_over:
                self.report_state(DeviceState.CLOSED, reason)
            self._state = DeviceState.CLOSED
            self._sink = None
            self._ended.set()

    def release(self) -> None:
        """Ends delivery permanently: `begin` raises from now on."""
        with self._lock:
            self._released = True
            self.end("closed")

    def begin_epoch(self) -> None:
        """Increments the epoch after a step of the device's clock."""
        with self._lock:
            self._epoch += 1

    def report_state(self, state: DeviceState, reason: str) -> None:
        """Reports a state; ignored while the gate is closed, so that a late thread cannot revive a device."""
        with self._lock:
            if self._sink is not None:
                self._state = state
                self._sink.on_state(state, reason)

    def guard(self, work: Callable[..., None], *arguments: Any) -> None:
        """Runs the work of a driver's thread; if it raises, the device has FAILED for the reason."""
        try:
            work(*arguments)
        except DeviceError as error:
            self.report_state(DeviceState.FAILED, str(error))
        except Exception as error:
            self.report_state(DeviceState.FAILED, f"the driver failed: {error!r}")
            raise

    def warn(self, condition: str, message: str) -> None:
        """See `drivers.contract.device.Sink.on_warning`."""
        with self._lock:
            if self._sink is not None:
                self._sink.on_warning(condition, message)

    def deliver_truth(self, truth: Truth) -> None:
        """Delivers ground truth of a simulated device."""
        with self._lock:
            if self._sink is not None:
                self._sink.on_truth(truth)

    def deliver(self, frame: Frame) -> None:
        """Delivers a frame, or counts the drop: `after_stop`, `unknown_stream`, `wrong_size`, `wrong_encoding`."""
        with self._lock:
            cause = self._drop_cause(frame)
            if cause not in ("after_stop", "unknown_stream"):
                self._note_form(frame, bool(cause))
            if cause:
                self._counters[cause] += 1
            elif self._sink is not None:
                self._counters["frames"] += 1
                self._sink.on_frame(frame)

    def deliver_stamped(self, frames: Iterable[Frame], stamp: Stamp, t_arrival_ns: int) -> None:
        """Delivers frames of one exposure with its host times; if the device's clock has stepped, in a new epoch."""
        if stamp.stepped:
            self.begin_epoch()
        times = {"t_host_ns": stamp.t_host_ns, "t_sigma_ns": stamp.t_sigma_ns, "t_arrival_ns": t_arrival_ns}
        for frame in frames:
            self.deliver(replace(frame, **times, epoch=self.epoch))

    def drop(self, cause: str, number: int = 1) -> None:
        """Counts frames that the driver itself dropped."""
        with self._lock:
            self._counters[cause] += number

    def _note_form(self, frame: Frame, unfit: bool) -> None:
        """Warns when many frames of a stream do not have its size or encoding, as after somebody else has set one."""
        latest, condition = self._unfit[frame.key], f"{frame.sensor}/{frame.stream} form"
        latest.append(unfit)
        if unfit and sum(latest) >= MANY:
            stream, (height, width) = self._streams[frame.key], frame.data.shape[:2]
            self._warned.add(condition)
            is_, wanted = f"{width}×{height} {frame.encoding}", f"{stream.width}×{stream.height} {stream.encoding}"
            self.warn(condition, f"{frame.sensor}/{frame.stream}: images of {is_} in place of {wanted}, not used")
        elif condition in self._warned and not any(latest):
            self._warned.remove(condition)
            self.warn(condition, "")

    def _drop_cause(self, frame: Frame) -> str:
        stream = self._streams.get(frame.key)
        if self._sink is None:
            return "after_stop"
        if stream is None:
            return "unknown_stream"
        if frame.data.shape[:2] != (stream.height, stream.width):
            return "wrong_size"
        return "wrong_encoding" if frame.encoding != stream.encoding else ""
