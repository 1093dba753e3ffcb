"""Detects streams that stall: no frame comes, or the same image again and again."""

import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from abs_service.capture.delivery_rate import DeliveryRate
from abs_service.capture.image_check import RepeatedImages, is_empty
from drivers.contract.capabilities import StreamInfo
from drivers.contract.device import DeviceState, Sink
from drivers.contract.frame import Frame, Kind
from drivers.encoding import codec

#: A stream without a frame for so many periods, and at least so long [ns], is stalled.
STALL_PERIODS, STALL_NS = 5, 1_000_000_000
#: Likewise, for the device to be reopened.
REOPEN_PERIODS, REOPEN_NS = 10, 5_000_000_000
#: Longest time from the state STREAMING to the first frame of a stream [ns].
WARM_UP_NS = 10_000_000_000


class StallDetector:
    """A sink that translates head names to sensor names, notes the arrival of frames, and leaves out repeated images.

    Args:
        sink: where wanted frames go.
        heads: sensor names by head of the device; frames of other heads are dropped and counted.
        streams: those that are monitored; none if the device delivers irregularly.
        clock: CLOCK_MONOTONIC [ns].
        first_epoch: added to the device's epochs.
        repeated_images: knows the latest images, also those before the device was opened again.

    Attributes:
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
        repeated_images: RepeatedImages,
    ) -> None:
        self._sink = sink
        self.on_truth = sink.on_truth
        self._heads = heads
        self._streams = {stream.key: stream for stream in streams if stream.sensor in heads}
        self._delivery_rate = DeliveryRate(self._streams)
        self._clock = clock
        self._first_epoch = first_epoch
        self._repeated_images = repeated_images
        self._counters = Counter({"malformed": 0, "unwanted": 0, "repeated": 0, "empty": 0})
        self._malformed = (0, "")  # time of the last one [ns], and what is wrong with it; "" if that was long ago
        self._repeating: set[tuple[str, str]] = set()
        self._empty_since_ns: dict[tuple[str, str], int] = {}
        self._latest_ns: dict[tuple[str, str], int] = {}
        self._awaited = set(self._streams)  # without a frame so far
        self._warnings: dict[str, str] = {}
        self._lock = threading.Lock()
        self.delivered = False
        self.state = (DeviceState.OPENING, "")

    def on_frame(self, frame: Frame) -> None:
        """See `drivers.contract.device.Sink.on_frame`; what is no valid frame is left out and counted."""
        try:
            name, epoch = self._heads.get(frame.sensor, frame.sensor), self._first_epoch + frame.epoch
            codec.check_frame(named := replace(frame, sensor=name, epoch=epoch))
        except Exception as error:  # whatever a driver hands over, its thread goes on
            self._counters["malformed"] += 1
            self._malformed = self._clock(), f"its driver delivers what is no frame: {error}"
            self.on_warning("frames", self._malformed[1])
            return
        if frame.sensor not in self._heads:
            self._counters["unwanted"] += 1
            return
        if frame.key in self._streams:
            self._delivery_rate.add(frame.key, self._clock())
        empty = is_empty(frame)
        self._note_content(frame, empty)
        if self._is_repeated(frame, empty):
            self._counters["repeated"] += 1
            self._repeating.add(frame.key)
            return
        self._repeating.discard(frame.key)
        self._latest_ns[frame.key] = self._clock()
        self._awaited.discard(frame.key)
        self.delivered = True
        self._sink.on_frame(named)

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

    @property
    def all_delivered(self) -> bool:
        """True after the first frame of each stream that is monitored."""
        return not self._awaited

    @property
    def counters(self) -> Mapping[str, int]:
        """`malformed` frames, `unwanted` ones of heads that the rig does not use, `repeated` and `empty` images.

        Only the empty ones are delivered.
        """
        return dict(self._counters)

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
        for (sensor, name), slow in self._delivery_rate.check(now_ns):
            self.on_warning(f"{sensor}/{name} rate", slow and f"{sensor}/{name}: {slow}")
        if self._malformed[1] and now_ns - self._malformed[0] > STALL_NS:
            self._malformed = (0, "")
            self.on_warning("frames", "")
        verdict = self.state
        for key, stream in self._streams.items():
            silent_ns = now_ns - self._latest_ns.get(key, now_ns)
            what = "delivers the same image" if key in self._repeating else "delivers nothing"
            silence = f"{key[0]}/{key[1]} {what} for {silent_ns / 1e9:.0f} s"
            reason = "; ".join(filter(None, (silence, self._malformed[1])))
            if _too_long(silent_ns, stream, REOPEN_PERIODS, REOPEN_NS):
                return DeviceState.FAILED, reason
            if _too_long(silent_ns, stream, STALL_PERIODS, STALL_NS):
                verdict = DeviceState.STALLED, reason
        return verdict

    def _note_content(self, frame: Frame, empty: bool) -> None:
        """Counts images that hold nothing; warns when a stream has had no others for too long."""
        name = f"{frame.sensor}/{frame.stream}"
        if not empty:
            if self._empty_since_ns.pop(frame.key, None) is not None:
                self.on_warning(f"{name} empty", "")
            return
        self._counters["empty"] += 1
        now_ns = self._clock()
        if now_ns - self._empty_since_ns.setdefault(frame.key, now_ns) > STALL_NS:
            self.on_warning(f"{name} empty", f"{name}: nothing in its images; is it covered, or its light off?")

    def _is_repeated(self, frame: Frame, empty: bool) -> bool:
        stream = self._streams.get(frame.key)
        # Always added, so that the image before is known. One without content has no noise.
        repeated = self._repeated_images.add(frame)
        return repeated and not empty and stream is not None and stream.noisy and stream.kind != Kind.BINARY


def _too_long(silent_ns: int, stream: StreamInfo, periods: int, minimum_ns: int) -> bool:
    return silent_ns > max(periods * 1e9 / stream.rate_hz, minimum_ns)
