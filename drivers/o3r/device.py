"""A head of the ifm O3R as a device.

ifm3d's frame grabber calls back from a thread of its own, which only puts messages into a queue; another takes them.
"""

import threading
from collections.abc import Callable, Mapping
from typing import Any

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.clock import DeviceClock, stream_gauges
from drivers.contract.controls import Controls
from drivers.contract.device import DeviceError, DeviceInfo, DeviceState, Sink
from drivers.contract.frame import Frame, Kind
from drivers.contract.frame_gate import FrameGate
from drivers.contract.frame_queue import FrameQueue
from drivers.o3r import live_message
from drivers.o3r.chunks import ChunkError
from drivers.o3r.exposure import CLOCK, SENSOR, Exposure
from drivers.o3r.head_link import HeadLink, end
from drivers.o3r.library import reason

#: Polling interval of the stop event [s].
_POLL_S = 0.1
#: Longest wait for the thread [s]; it ends later by itself if the network has gone while ifm3d connects.
_JOIN_S = 5.0


class O3rDevice:
    """Delivers the images of one head.

    Args:
        link: to the head.
        info: its identity.
        first: one of its exposures.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        ChunkError: unsupported lens model.
    """

    def __init__(self, link: HeadLink, info: DeviceInfo, first: Exposure, clock: Callable[[], int]) -> None:
        self.info = info
        self.controls = Controls()
        self.cameras: Mapping[str, Camera] = {SENSOR: first.camera}
        self._link = link
        self._clock = clock
        self._calib_id = first.camera.calib_id
        streams = tuple(_info(frame, link.head.rate_hz) for frame in first.frames(self._calib_id, link.head.mode))
        self.capabilities = Capabilities(streams)
        self._gate = FrameGate(streams, causes=["missing", "overrun", "undecodable"])
        self._lock = threading.RLock()
        self._thread = threading.Thread()
        self._mapping = DeviceClock(CLOCK)

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `missing`, which never came, by the head's numbers; `overrun`; `undecodable`."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping, which all streams share."""
        return stream_gauges([((SENSOR, "depth"), self._mapping)])

    def start(self, sink: Sink) -> None:
        """See `drivers.contract.device.Device.start`."""
        with self._lock:
            stop = self._gate.begin(sink, "connecting to the camera head")
            if stop is None:
                return
            self._mapping = DeviceClock(CLOCK)
            queue: FrameQueue[tuple[Any, int]] = FrameQueue()
            try:
                grabber = self._link.grab(
                    lambda message: queue.put((message, self._clock())), lambda error: queue.end(reason(error))
                )
            except DeviceError as error:
                self._gate.report_state(DeviceState.FAILED, str(error))
                raise
            arguments = self._pump, stop, grabber, queue
            self._thread = threading.Thread(target=self._gate.guard, args=arguments, name="o3r", daemon=True)
            self._gate.report_state(DeviceState.STREAMING, "images follow")
            self._thread.start()

    def stop(self) -> None:
        """See `drivers.contract.device.Device.stop`."""
        self._gate.end("stopped")
        with self._lock:
            thread = self._thread
        if thread.is_alive() and thread is not threading.current_thread():
            thread.join(_JOIN_S)

    def close(self) -> None:
        """See `drivers.contract.device.Device.close`."""
        self._gate.release()
        self.stop()

    def _pump(self, stop: threading.Event, grabber: Any, queue: FrameQueue[tuple[Any, int]]) -> None:
        latest = None
        try:
            while not stop.is_set():
                item = queue.take(_POLL_S)
                overrun = queue.dropped()
                self._gate.drop("overrun", overrun * len(self.capabilities.streams))
                if item is not None:
                    number = item[0].frame_count()
                    self._count_missing(number if latest is None else latest + overrun + 1, number)
                    latest = number
                    self._deliver(*item)
                elif queue.ended():
                    raise DeviceError(queue.ended())
        finally:
            end(grabber)

    def _count_missing(self, expected: int, number: int) -> None:
        if number < expected:  # the head was configured anew and counts from the beginning
            self._gate.begin_epoch()
        self._gate.drop("missing", max(number - expected, 0) * len(self.capabilities.streams))

    def _deliver(self, message: Any, t_arrival_ns: int) -> None:
        try:
            exposure = live_message.decoded(self._link.ifm3d, message)
            frames = list(exposure.frames(self._calib_id, self._link.head.mode))
        except ChunkError:
            self._gate.drop("undecodable", len(self.capabilities.streams))
            return
        self._gate.drop("missing", max(len(self.capabilities.streams) - len(frames), 0))
        stamp = self._mapping.stamp(exposure.time_ns, t_arrival_ns)
        self._gate.deliver_stamped(frames, stamp, t_arrival_ns)


def _info(frame: Frame, rate_hz: float) -> StreamInfo:
    height, width = frame.data.shape
    # Flags are no measurements, and how deviations come about is the head's affair: both may repeat.
    noisy = frame.kind in {Kind.DEPTH, Kind.AMPLITUDE}
    return StreamInfo(*frame.key, frame.kind, frame.encoding, width, height, rate_hz, CLOCK, noisy)
