"""Real-time playback of a recording as a device."""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, ClockInfo, StreamInfo
from drivers.contract.controls import Controls
from drivers.contract.device import DeviceInfo, DeviceState, Sink, Truth
from drivers.contract.frame import Frame
from drivers.contract.frame_gate import FrameGate
from drivers.replay.contents import RecordingError
from drivers.replay.recording import Recording

#: Longer gaps of a recording [s] are logged as a pause: they last as long as recorded.
PAUSE_S = 5.0

#: Longest time after images were delivered in which nothing is read, at most a quarter of that until the next ones [s].
REST_S = 0.006

#: Waits until the event is set or the timeout [s] has passed; returns True if it is set.
Wait = Callable[[threading.Event, float], bool]


class ReplayDevice:
    """Delivers the frames of a recording at `speed` times real time, with new host times and epochs.

    Host times keep their differences (divided by `speed`) and start now; sequence numbers and device ticks are
    unchanged. Nothing is dropped: a replay that falls behind delivers late.

    Args:
        uri: the address that opened it.
        recording: the recording.
        speed: playback speed.
        loop: restart at the end, in a new epoch.
        clock: CLOCK_MONOTONIC [ns].
        wait: waiting function, replaced in tests.
        delay_s: time before the first frame [s].

    Raises:
        RecordingError: a stream without frames, or a sensor without a camera model.
    """

    def __init__(
        self,
        uri: str,
        recording: Recording,
        speed: float,
        loop: bool,
        clock: Callable[[], int],
        wait: Wait = threading.Event.wait,
        delay_s: float = 0.0,
    ) -> None:
        self.info = DeviceInfo(uri=uri, model="replay", serial=recording.path.name)
        self.capabilities = Capabilities(_streams(recording, speed), regular=False)
        self.cameras: Mapping[str, Camera] = recording.cameras
        self.controls = Controls()
        self._recording = recording
        self._speed = speed
        self._loop = loop
        self._clock = clock
        self._wait = wait
        self._delay_s = delay_s
        self._gate = FrameGate(self.capabilities.streams, causes=["unpaired", "malformed"])
        self._next_epoch = 0
        self._thread = threading.Thread()

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `malformed` frames and `unpaired` images or metadata in the file."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Empty: the recorded clocks are not running."""
        return {}

    def start(self, sink: Sink) -> None:
        """Starts at the beginning; no effect while it is running.

        Raises:
            DeviceError: the device was closed.
        """
        if stop := self._gate.begin(sink, f"begins {self._delay_s:g} s after it was started"):
            self._thread = threading.Thread(target=self._gate.guard, args=(self._run, stop), name="replay", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stops delivery; the sink is not called after it returns."""
        self._gate.end("stopped")
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def close(self) -> None:
        """Stops; no file is held open."""
        self._gate.release()
        self.stop()

    def _run(self, stop: threading.Event) -> None:
        self._wait(stop, self._delay_s)
        self._gate.report_state(DeviceState.STREAMING, f"replaying {self._recording.path}")
        try:
            while self._play(stop) and self._loop:
                pass
        except RecordingError as error:
            # Final: opened again, it would play from the beginning up to here, for ever.
            self._gate.report_state(DeviceState.BROKEN, str(error))
            return
        except OSError as error:  # a disk that is taken away may come back
            self._gate.report_state(DeviceState.FAILED, str(error))
            return
        if not stop.is_set():
            self._gate.end("the recording ended")

    def _play(self, stop: threading.Event) -> bool:
        """Plays the file once; returns True unless stopped. Each recorded epoch becomes one epoch of the device."""
        epochs: dict[int, int] = {}
        for t_host_ns, item in self._due(stop):
            if isinstance(item, Truth):
                self._gate.deliver_truth(replace(item, t_host_ns=t_host_ns))
                continue
            epoch = epochs.setdefault(item.epoch, self._next_epoch + len(epochs))
            times = {"t_host_ns": t_host_ns, "t_arrival_ns": self._clock(), "host_clock": ""}
            self._gate.deliver(replace(item, **times, epoch=epoch))
        self._next_epoch += len(epochs)
        return not stop.is_set()

    def _due(self, stop: threading.Event) -> Iterator[tuple[int, Frame | Truth]]:
        """Frames and truths with new host times, each when it is due; some are read before that, in spare time."""
        timeline, malformed = _Timeline(self._clock(), self._speed), 0
        ahead: deque[tuple[int, Frame | Truth]] = deque()
        maximum = len(self.capabilities.streams) + 1  # those of one moment, and its truth
        failure: Exception | None = None
        try:
            for item in self._recording.frames():
                self._gate.drop("malformed", self._recording.malformed - malformed)
                malformed = self._recording.malformed
                ahead.append((timeline.time_ns(item), item))
                while ahead and (len(ahead) > maximum or ahead[0][0] <= self._clock()):
                    if self._wait_for(ahead[0][0], stop):
                        return
                    yield ahead.popleft()
                    if ahead:  # whoever publishes what is due goes before whoever reads what is not
                        self._wait(stop, min(REST_S, max(ahead[0][0] - self._clock(), 0) * 1e-9 / 4))
        except (RecordingError, OSError) as error:
            failure = error
        for t_host_ns, item in ahead:
            if self._wait_for(t_host_ns, stop):
                return
            yield t_host_ns, item
        if failure is not None:
            raise failure
        self._gate.drop("malformed", self._recording.malformed - malformed)
        self._gate.drop("unpaired", self._recording.unpaired)

    def _wait_for(self, t_host_ns: int, stop: threading.Event) -> bool:
        """Waits until a host time; returns True if the replay is stopped. A long wait is logged."""
        left_s = max(t_host_ns - self._clock(), 0) * 1e-9
        is_pause = left_s > PAUSE_S
        if is_pause:
            what = f"nothing was recorded for the next {left_s:.0f} s of the replay"
            self._gate.warn("pause", f"{what}, which waits for them; `abs-service replay` without --speed does not")
        is_stopped = self._wait(stop, left_s)
        if is_pause:
            self._gate.warn("pause", "")
        return is_stopped


class _Timeline:
    """Host times of a replay that begins now.

    Args:
        begin_ns: now [ns].
        speed: of the replay.
    """

    def __init__(self, begin_ns: int, speed: float) -> None:
        self._latest_ns = begin_ns
        self._speed = speed
        self._host_clock = ""
        # By host clock, which a reboot changes: its first time, and when that is due.
        self._begins: dict[str, tuple[int, int]] = {}

    def time_ns(self, item: Frame | Truth) -> int:
        """Host time [ns] at which the next item of the file is due."""
        self._host_clock = item.host_clock if isinstance(item, Frame) else self._host_clock
        unnamed = self._begins.pop("", (item.t_host_ns, self._latest_ns))  # of truths before the first frame
        first_ns, begin_ns = self._begins.setdefault(self._host_clock, unnamed)
        t_host_ns = begin_ns + round((item.t_host_ns - first_ns) / self._speed)
        self._latest_ns = max(self._latest_ns, t_host_ns)
        return t_host_ns


def _streams(recording: Recording, speed: float) -> tuple[StreamInfo, ...]:
    """Stream properties, from the first frame of each stream."""
    first = recording.first_frames()
    for sensor, stream in recording.counts:
        if (sensor, stream) not in first:
            raise RecordingError(f"{recording.path}: {sensor}/{stream} has no frame that can be read")
        if sensor not in recording.cameras:
            raise RecordingError(
                f"{recording.path}: topic /{sensor}/model with the camera model of {sensor} is missing"
            )
    return tuple(
        StreamInfo(
            frame.sensor,
            frame.stream,
            frame.kind,
            frame.encoding,
            frame.data.shape[1],
            frame.data.shape[0],
            speed * recording.rate_hz(frame),
            ClockInfo(frame.clock_domain, frame.tick_hz),
        )
        for frame in (first[key] for key in recording.counts)
    )
