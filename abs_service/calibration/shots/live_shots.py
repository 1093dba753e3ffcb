"""Shots of running devices: always the newest, independent of the processing time."""

import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from abs_service.calibration.shots.shots import USED, Assembler, Shot, ShotsError
from abs_service.pairing.synchroniser import Synchroniser
from calib.camera import Camera
from drivers.contract.device import Device, DeviceState, Sink
from drivers.contract.frame import Frame, FrameSet

#: Capacity of the frame queue; the oldest frames are dropped.
_WAITING = 256
#: Timeout without frames after which a rig has failed [s].
SILENCE_S = 10.0


@dataclass(frozen=True)
class NamedDevice:
    """Opened device, with the rig names of its selected heads."""

    device: Device
    heads: Mapping[str, str]


class LiveShots:
    """Shots of a rig; a context manager that starts and closes its devices.

    Args:
        devices: opened, by name.
        cameras: of every sensor, by its name in the rig.
        tolerance_ns: largest time difference between images of one shot [ns].
        clock: CLOCK_MONOTONIC [ns].
        is_over: polled; True ends the iteration.
    """

    def __init__(
        self,
        devices: Mapping[str, NamedDevice],
        cameras: Mapping[str, Camera],
        tolerance_ns: int,
        clock: Callable[[], int],
        is_over: Callable[[], bool] = lambda: False,
    ) -> None:
        self._devices = devices
        self._is_over = is_over
        self._clock = clock
        self._assembler = Assembler(cameras)
        self._inboxes = {name: _Inbox(wired.heads) for name, wired in devices.items()}
        streams = [
            (wired.heads[stream.sensor], stream)
            for wired in devices.values()
            for stream in wired.device.capabilities.streams
            if stream.sensor in wired.heads and stream.kind in USED
        ]
        if not streams:
            raise ShotsError("no sensor of this rig makes images in which a board can be seen")
        slowest = min(streams, key=lambda item: item[1].rate_hz)
        self._synchroniser = Synchroniser(
            (slowest[0], slowest[1].stream), [(sensor, stream.stream) for sensor, stream in streams], tolerance_ns
        )
        self._used = {(sensor, stream.stream) for sensor, stream in streams}

    def __enter__(self) -> "LiveShots":
        """Starts all devices.

        Raises:
            DeviceError: one cannot stream.
        """
        for name, wired in self._devices.items():
            wired.device.start(self._inboxes[name])
        return self

    def __exit__(self, *_: object) -> None:
        """Closes all devices."""
        for wired in self._devices.values():
            wired.device.close()

    def __iter__(self) -> Iterator[Shot]:
        """Newest shot on every iteration, until `is_over` or the end of all devices.

        Raises:
            ShotsError: a device failed, or frames timed out.
        """
        number, last, received_ns = 0, None, self._clock()
        while not self._is_over():
            ended = all(inbox.state == DeviceState.CLOSED for inbox in self._inboxes.values())
            self._check_devices()
            sets = self._new_sets()
            if sets:
                received_ns = self._clock()
                pair = [last or sets[0], *sets][-2:]
                last = pair[1]
                # The very first set has no predecessor, so its motion is unknown.
                if pair[0] is not pair[1]:
                    yield self._assembler.shot(number, pair[1], pair[0])
                    number += 1
            elif ended:
                return
            elif self._clock() - received_ns > SILENCE_S * 1e9:
                raise ShotsError(f"no images for {SILENCE_S:g} s; `abs-service devices` shows what is connected")
            else:
                next(iter(self._inboxes.values())).wait(0.05)

    def _new_sets(self) -> Sequence[FrameSet]:
        sets: list[FrameSet] = []
        frames = [frame for inbox in self._inboxes.values() for frame in inbox.take() if frame.key in self._used]
        for frame in sorted(frames, key=lambda frame: frame.t_arrival_ns):
            sets += self._synchroniser.add(frame)
        return sets + self._synchroniser.poll(self._clock())

    def _check_devices(self) -> None:
        for name, inbox in self._inboxes.items():
            if inbox.state in (DeviceState.FAILED, DeviceState.BROKEN):
                raise ShotsError(f"device {name} failed: {inbox.reason}")


class _Inbox(Sink):
    """Frame sink that keeps the newest frames, under their rig names."""

    def __init__(self, heads: Mapping[str, str]) -> None:
        self._heads = heads
        self._frames: deque[Frame] = deque(maxlen=_WAITING)
        self._arrived = threading.Event()
        self.state = DeviceState.OPENING
        self.reason = ""

    def take(self) -> list[Frame]:
        """Frames since the last call."""
        self._arrived.clear()
        taken = []
        while self._frames:
            taken.append(self._frames.popleft())
        return taken

    def wait(self, seconds: float) -> None:
        """Waits for a frame, with a timeout."""
        self._arrived.wait(seconds)

    def on_frame(self, frame: Frame) -> None:
        if frame.sensor in self._heads:
            self._frames.append(replace(frame, sensor=self._heads[frame.sensor]))
            self._arrived.set()

    def on_state(self, state: DeviceState, reason: str) -> None:
        self.state, self.reason = state, reason
        self._arrived.set()
