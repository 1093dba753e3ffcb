"""An Orbbec camera as a device, on the SDK's sensors and callbacks.

The SDK calls back from its own threads. A callback only puts an image into a queue: a Python exception must not reach
the SDK, stopping a sensor waits for its callback, and the SDK keeps the callback, so it may not keep the device.
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, StreamInfo, SyncRole
from drivers.contract.clock import DeviceClock, stream_gauges
from drivers.contract.device import DeviceError, DeviceInfo, DeviceState, Sink
from drivers.contract.frame_gate import FrameGate
from drivers.contract.frame_queue import FrameQueue
from drivers.orbbec import controls
from drivers.orbbec.calibration import cameras
from drivers.orbbec.library import translated_errors
from drivers.orbbec.picture import CLOCK, frame, from_frame
from drivers.orbbec.streams import Role, Stream

_log = logging.getLogger(__name__)

#: Polling interval of the stop event [s].
_POLL_S = 0.1
#: Time without images after which the origin is asked whether it has ended [s].
_SILENT_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class _Arrival:
    """An image of a stream, its time of arrival [ns], and the number of images missing before it."""

    role: Role
    image: Any
    t_ns: int
    missing: int


@dataclass(frozen=True, slots=True, eq=False)
class Origin:
    """A camera or a recording.

    Attributes:
        ob: pyorbbecsdk.
        context: `ob.Context` with our settings, held as long as the camera.
        camera: `ob.Device`, also an `ob.PlaybackDevice`.
        info: its identity.
        ended: state and reason if no more images can come, None otherwise; asked when there are none.
        regular: True for a camera, whose silence is a fault.
    """

    ob: Any
    context: Any
    camera: Any
    info: DeviceInfo
    ended: Callable[[], tuple[DeviceState, str] | None]
    regular: bool = True


class OrbbecDevice:
    """Delivers the streams of a camera or a recording.

    Args:
        origin: the camera.
        streams: in use, at least one.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        DeviceError: invalid calibration.
    """

    def __init__(self, origin: Origin, streams: Sequence[Stream], clock: Callable[[], int]) -> None:
        self.info = origin.info
        self._origin: Origin | None = origin
        self._streams = streams
        self._clock = clock
        self._lock = threading.RLock()
        self._running: list[Any] = []
        self._thread = threading.Thread()
        self._clocks: dict[Role, DeviceClock] = {}
        self._filters: tuple[str, ...] = ()
        with translated_errors(self.info.uri):
            self.cameras: Mapping[str, Camera] = cameras(streams)
            self.controls = controls.make(origin.ob, self.info.uri, self._camera)
            modes = controls.sync_modes(origin.ob, origin.camera)
        infos = tuple(_info(stream) for stream in streams)
        roles = tuple(SyncRole(role) for role in modes) or (SyncRole.FREE,)
        self.capabilities = Capabilities(infos, self.controls.infos, roles, regular=origin.regular)
        self._gate = FrameGate(infos, causes=["missing", "overrun", "undecodable"])

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `missing`: lost before they came here; `overrun`: from a full queue; `undecodable`."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping of each stream."""
        return stream_gauges(((role.sensor, role.stream), clock) for role, clock in list(self._clocks.items()))

    def start(self, sink: Sink) -> None:
        """See `drivers.contract.device.Device.start`."""
        with self._lock:
            stop = self._gate.begin(sink, "opening the camera's sensors")
            origin = self._origin
            if stop is None or origin is None:
                return
            self._halt()  # a stream that ended by itself still holds its sensors
            queue: FrameQueue[_Arrival] = FrameQueue(4 * len(self._streams))
            self._clocks = {stream.role: DeviceClock(CLOCK) for stream in self._streams}
            try:
                with translated_errors(self.info.uri):
                    self._filters = controls.filters(origin.ob, origin.camera)
                    self._open_sensors(queue)
            except DeviceError as error:
                self._halt()
                self._gate.report_state(DeviceState.FAILED, str(error))
                raise
            self._gate.report_state(DeviceState.STREAMING, "images follow")
            arguments = self._pump, origin, stop, queue
            self._thread = threading.Thread(target=self._gate.guard, args=arguments, name="orbbec", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """See `drivers.contract.device.Device.stop`."""
        self._gate.end("stopped")
        with self._lock:
            self._halt()
            thread = self._thread
        if thread.is_alive() and thread is not threading.current_thread():
            thread.join()

    def close(self) -> None:
        """See `drivers.contract.device.Device.close`."""
        self._gate.release()
        self.stop()
        with self._lock:
            self._origin, self._streams = None, ()  # the SDK closes a camera that nobody holds

    def _camera(self) -> Any:
        origin = self._origin
        if origin is None:
            raise DeviceError(f"{self.info.uri}: the device was closed")
        return origin.camera

    def _open_sensors(self, queue: FrameQueue[_Arrival]) -> None:
        for stream in self._streams:
            stream.sensor.start(stream.profile, _callback(stream.role, queue, self._clock))
            self._running.append(stream.sensor)

    def _halt(self) -> None:
        """Stops the running sensors."""
        while self._running:
            try:
                self._running.pop().stop()
            except Exception:  # the SDK's own exception, for a lost camera
                continue

    def _pump(self, origin: Origin, stop: threading.Event, queue: FrameQueue[_Arrival]) -> None:
        latest = time.monotonic()
        while not stop.is_set():
            item = queue.take(_POLL_S)
            self._gate.drop("overrun", queue.dropped())
            if item is not None:
                latest = time.monotonic()
                self._deliver(origin.ob, item)
            elif time.monotonic() - latest > _SILENT_S and (end := origin.ended()) is not None:
                self._gate.report_state(*end)
                return

    def _deliver(self, ob: Any, arrival: _Arrival) -> None:
        role = arrival.role
        self._gate.drop("missing", arrival.missing)
        try:
            picture = from_frame(ob, arrival.image, role.kind)
            made = frame(picture, role, self.cameras[role.sensor].calib_id, self._filters)
        except Exception:  # the SDK's exceptions, which have no common base, and ours
            self._gate.drop("undecodable")
            return
        stamp = self._clocks[role].stamp(picture.time_us, arrival.t_ns)
        self._gate.deliver_stamped([made], stamp, arrival.t_ns)


def _callback(role: Role, queue: FrameQueue[_Arrival], clock: Callable[[], int]) -> Callable[[Any], None]:
    last: int | None = None

    def take(image: Any) -> None:
        nonlocal last
        try:
            number = image.get_index()
            # The SDK leaves out an image of which a part was lost, without a word but a gap in the numbers.
            missing = max(number - last - 1, 0) if last is not None else 0
            last = number
            queue.put(_Arrival(role, image, clock(), missing))
        except Exception:  # no exception may reach the SDK
            _log.exception("an image was lost")

    return take


def _info(stream: Stream) -> StreamInfo:
    role, profile = stream.role, stream.profile
    size = profile.get_width(), profile.get_height()
    return StreamInfo(role.sensor, role.stream, role.kind, stream.encoding, *size, float(profile.get_fps()), CLOCK)
