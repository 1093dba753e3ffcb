"""An OAK as a device: one thread per stream takes images from its queue and delivers them."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.clock import stream_gauges
from drivers.contract.device import DeviceError, DeviceState, Sink
from drivers.contract.frame_gate import FrameGate
from drivers.oak.eeprom import EepromError
from drivers.oak.images.heads import cameras
from drivers.oak.images.messages import QueueClosed
from drivers.oak.images.picture import Picture, PictureError, frame, pixels
from drivers.oak.roles import Role
from drivers.oak.source.connection import CLOCK, Connection, HostTimes

#: Timeout for the first image of a stream, exposure settling included [s].
FIRST_S = 10.0
#: Polling interval of the stop event [s].
_POLL_S = 0.1


class OakDevice:
    """Delivers the images of a pipeline while started; the pipeline runs from opening to closing.

    Args:
        connection: the running pipeline; closed if the constructor fails.
        clock: CLOCK_MONOTONIC [ns].
        first_s: timeout for the first image of a stream [s].

    Raises:
        DeviceError: a stream has no images, or no usable ones.
    """

    def __init__(self, connection: Connection, clock: Callable[[], int], first_s: float = FIRST_S) -> None:
        self._connection = connection
        self._clock = clock
        self._lock = threading.Lock()
        self._open = True
        self._flowing = 0  # streams that have not ended
        self._threads: list[threading.Thread] = []
        self._clocks: dict[Role, HostTimes] = {}
        self.info = connection.info
        self.controls = connection.controls
        try:
            first = {role: self._first(role, first_s) for role in connection.queues}
            self.cameras: Mapping[str, Camera] = cameras(first, connection.poses)
            streams = tuple(_stream(role, picture, connection.rate_hz) for role, picture in first.items())
        except (PictureError, EepromError, QueueClosed) as error:
            self._release()
            raise DeviceError(f"{self.info.uri}: {error}") from error
        except DeviceError:
            self._release()
            raise
        self.capabilities = Capabilities(streams, connection.controls.infos, connection.sync_roles)
        self._gate = FrameGate(streams, causes=["undecodable", "range_changes"])

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `undecodable` messages; `range_changes`: images of an uncertain range, after a change."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Self-measurements of the device, and the clock mapping of each stream."""
        clocks = stream_gauges((role.key, clock) for role, clock in list(self._clocks.items()))
        return clocks | dict(self._connection.gauges()) if self._open else clocks

    def start(self, sink: Sink) -> None:
        """See `drivers.contract.device.Device.start`."""
        stop = self._gate.begin(sink, "the pipeline runs already")
        if stop is None:
            return
        self._clocks = {role: self._connection.host_times() for role in self._connection.queues}
        before = self._threads
        self._threads = [
            threading.Thread(
                target=self._gate.guard,
                args=(self._pump, role, stop, before),
                name=f"oak {role.sensor}/{role.stream}",
                daemon=True,
            )
            for role in self._connection.queues
        ]
        self._flowing = len(self._threads)
        self._gate.report_state(DeviceState.STREAMING, "images follow")
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """See `drivers.contract.device.Device.stop`."""
        self._gate.end("stopped")
        # In the sink a join would deadlock; the threads end by themselves.
        if threading.current_thread() not in self._threads:
            _join(self._threads)

    def close(self) -> None:
        """See `drivers.contract.device.Device.close`."""
        self._gate.release()
        self.stop()
        self._release()

    def _release(self) -> None:
        with self._lock:
            was_open, self._open = self._open, False
        if was_open:
            self._connection.close()

    def _first(self, role: Role, timeout_s: float) -> Picture:
        picture = self._connection.queues[role].get(timeout_s)
        if picture is None:
            raise DeviceError(f"{self.info.uri}: {role.sensor}/{role.stream} delivers nothing for {timeout_s:g} s")
        return picture

    def _pump(self, role: Role, stop: threading.Event, before: Sequence[threading.Thread]) -> None:
        """Delivers one stream until the stop event is set or the queue is closed."""
        _join(before)
        queue = self._connection.queues[role]
        try:
            queue.clear()
            while not stop.is_set():
                try:
                    picture = queue.get(_POLL_S)
                    if picture is not None and not stop.is_set():
                        self._deliver(role, picture)
                except PictureError:
                    self._gate.drop("undecodable")
        except QueueClosed as error:
            with self._lock:
                self._flowing -= 1
                is_last = self._flowing == 0
            if is_last:
                over = self._connection.ended
                state = DeviceState.CLOSED if over else DeviceState.FAILED
                self._gate.report_state(state, over or f"the device is gone: {error}")

    def _deliver(self, role: Role, picture: Picture) -> None:
        t_arrival_ns = self._clock()
        filters = self._connection.filters.get(role, ())
        made = frame(picture, role, self.cameras[role.sensor].calib_id, filters)
        came_ns = self._connection.stamp(picture, t_arrival_ns) - picture.half_exposure_ns
        stamp = self._clocks[role].stamp(made.t_device_ticks, came_ns)
        modulation = self._connection.modulation(role, stamp.t_host_ns)
        known = [] if modulation is None else [replace(made, modulation=modulation)]
        self._gate.drop("range_changes", 1 - len(known))
        self._gate.deliver_stamped(known, stamp, t_arrival_ns)


def _join(threads: Sequence[threading.Thread]) -> None:
    for thread in threads:
        if thread.is_alive():
            thread.join()


def _stream(role: Role, picture: Picture, rate_hz: float) -> StreamInfo:
    encoding, image = pixels(picture, role.kind)
    height, width = image.shape[:2]
    return StreamInfo(role.sensor, role.stream, role.kind, encoding, width, height, rate_hz, CLOCK)
