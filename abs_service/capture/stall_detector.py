"""Detects streams that stall, from the arrival times of their frames."""

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from drivers.contract.capabilities import StreamInfo
from drivers.contract.device import DeviceState, Sink, Truth
from drivers.contract.frame import Frame

#: A stream without a frame for so many periods, and at least so long [ns], is stalled.
STALL_PERIODS, STALL_NS = 5, 1_000_000_000
#: Likewise, for the device to be reopened.
REOPEN_PERIODS, REOPEN_NS = 10, 5_000_000_000
#: Longest time from the state STREAMING to the first frame of a stream [ns].
WARM_UP_NS = 10_000_000_000


class StallDetector:
    """A sink that translates head names to sensor names and notes the arrival of frames.

    Args:
        sink: where wanted frames go.
        heads: sensor names by head of the device; frames of other heads are dropped and counted.
        streams: those that are monitored; none if the device delivers irregularly.
        clock: CLOCK_MONOTONIC [ns].
        first_epoch: added to the device's epochs.

    Attributes:
        unwanted: frames of heads that the rig does not use.
        delivered: True after the first frame.
        state: last state reported by the device, and its reason.
    """

    def __init__(
        self,
        sink: Sink,
        heads: Mapping[str, str],
        streams: Iterable[StreamInfo],
        clock: Callable[[], int],
        first_epoch: int,
    ) -> None:
        self._sink = sink
        self._heads = heads
        self._streams = {stream.key: stream for stream in streams if stream.sensor in heads}
        self._clock = clock
        self._first_epoch = first_epoch
        self._latest_ns: dict[tuple[str, str], int] = {}
        self._warnings: dict[str, str] = {}
        self._lock = threading.Lock()
        self.unwanted = 0
        self.delivered = False
        self.state = (DeviceState.OPENING, "")

    def on_frame(self, frame: Frame) -> None:
        """See `drivers.contract.device.Sink.on_frame`."""
        self._latest_ns[frame.key] = self._clock()
        self.delivered = True
        sensor = self._heads.get(frame.sensor)
        if sensor is None:
            self.unwanted += 1
            return
        self._sink.on_frame(replace(frame, sensor=sensor, epoch=self._first_epoch + frame.epoch))

    def on_truth(self, truth: Truth) -> None:
        """See `drivers.contract.device.Sink.on_truth`."""
        self._sink.on_truth(truth)

    def on_state(self, state: DeviceState, reason: str) -> None:
        """See `drivers.contract.device.Sink.on_state`."""
        if state == DeviceState.STREAMING:
            begin_ns = self._clock() + WARM_UP_NS
            self._latest_ns |= dict.fromkeys(self._streams, begin_ns) | self._latest_ns
        self.state = (state, reason)
        self._sink.on_state(state, reason)

    def on_warning(self, condition: str, message: str) -> None:
        """See `drivers.contract.device.Sink.on_warning`."""
        with self._lock:
            self._warnings[condition] = message
        self._sink.on_warning(condition, message)

    def take_warnings(self) -> Mapping[str, str]:
        """Warnings since the last call, by condition."""
        with self._lock:
            warnings, self._warnings = self._warnings, {}
        return warnings

    def check(self) -> tuple[DeviceState, str]:
        """STREAMING if no stream stalls, otherwise STALLED or FAILED; and the reason."""
        if self.state[0] != DeviceState.STREAMING:
            return self.state
        now_ns = self._clock()
        verdict = self.state
        for key, stream in self._streams.items():
            silent_ns = now_ns - self._latest_ns.get(key, now_ns)
            reason = f"{key[0]}/{key[1]} delivers nothing for {silent_ns / 1e9:.0f} s"
            if _too_long(silent_ns, stream, REOPEN_PERIODS, REOPEN_NS):
                return DeviceState.FAILED, reason
            if _too_long(silent_ns, stream, STALL_PERIODS, STALL_NS):
                verdict = DeviceState.STALLED, reason
        return verdict


def _too_long(silent_ns: int, stream: StreamInfo, periods: int, minimum_ns: int) -> bool:
    return silent_ns > max(periods * 1e9 / stream.rate_hz, minimum_ns)
