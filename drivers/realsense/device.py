"""A RealSense as a device, on librealsense's sensors and callbacks.

librealsense calls back from its own threads. The callbacks only put frames into a queue and take no other lock: a
Python exception must not reach the SDK, and stopping a sensor waits for its callbacks.
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
from drivers.contract.frame import Kind
from drivers.contract.frame_gate import FrameGate
from drivers.contract.frame_queue import FrameQueue
from drivers.realsense import controls
from drivers.realsense.library import translated_errors
from drivers.realsense.picture import CLOCK, HARDWARE, Picture, frame, from_frame
from drivers.realsense.profiles import Stream, cameras
from drivers.realsense.streams import Role

_log = logging.getLogger(__name__)

#: Polling interval of the stop event [s].
_POLL_S = 0.1
#: Time without images after which the connection is checked [s].
_SILENT_S = 1.0
_NO_METADATA = (
    "images are stamped by {}, not by the camera, because the kernel withholds their metadata; librealsense's "
    "installation page says how to patch it"
)


@dataclass(frozen=True, slots=True, eq=False)
class UsedSensor:
    """A sensor of the camera, and its streams in use."""

    sensor: Any
    streams: Sequence[Stream]

    @property
    def role(self) -> Role:
        """The role that names its controls: of colour only if it has no other stream."""
        roles = [stream.role for stream in self.streams]
        return next((role for role in roles if role.kind != Kind.COLOR), roles[0])


class RealsenseDevice:
    """Delivers the streams of a camera, a recording, or a software device.

    Args:
        rs: pyrealsense2.
        camera: `rs.device`, also of a playback or a software device.
        info: its identity.
        used: its sensors with the streams in use.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        DeviceError: invalid calibration.
    """

    def __init__(
        self, rs: Any, camera: Any, info: DeviceInfo, used: Sequence[UsedSensor], clock: Callable[[], int]
    ) -> None:
        self.info = info
        self._rs = rs
        self._camera = camera
        self._used = used
        self._clock = clock
        self._lock = threading.RLock()
        self._running: list[Any] = []
        self._warned = False
        self._thread = threading.Thread()
        self._clocks: dict[Role, DeviceClock] = {}
        self._queue: FrameQueue[tuple[Role, Any, int]] = FrameQueue()
        streams = [stream for one in used for stream in one.streams]
        with translated_errors(info.uri):
            self.cameras: Mapping[str, Camera] = cameras(streams)
            sensors = [(one.sensor, one.role) for one in used]
            self.controls = controls.make(rs, info.uri, sensors)
            roles = tuple(SyncRole) if controls.can_sync(rs, sensors) else (SyncRole.FREE,)
        infos = tuple(_info(stream) for stream in streams)
        self.capabilities = Capabilities(infos, self.controls.infos, roles)
        self._gate = FrameGate(infos, causes=["overrun", "undecodable"])

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `overrun`: dropped from a full queue; `undecodable`."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping of each stream."""
        return stream_gauges(((role.sensor, role.stream), clock) for role, clock in list(self._clocks.items()))

    def start(self, sink: Sink) -> None:
        """See `drivers.contract.device.Device.start`."""
        with self._lock:
            stop = self._gate.begin(sink, "opening the camera's sensors")
            if stop is None:
                return
            self._halt()  # a stream that ended by itself still holds its sensors
            self._queue = FrameQueue(4 * sum(len(one.streams) for one in self._used))
            self._clocks = {stream.role: DeviceClock(CLOCK) for one in self._used for stream in one.streams}
            try:
                with translated_errors(self.info.uri):
                    self._open_sensors(self._queue)
            except DeviceError as error:
                self._halt()
                self._gate.report_state(DeviceState.FAILED, str(error))
                raise
            arguments = self._pump, stop, self._queue
            self._thread = threading.Thread(target=self._gate.guard, args=arguments, name="realsense", daemon=True)
            self._gate.report_state(DeviceState.STREAMING, "images follow")
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

    def end(self, reason: str) -> None:
        """Marks the end of the stream; called by callbacks."""
        self._queue.end(reason)

    def _open_sensors(self, queue: FrameQueue[tuple[Role, Any, int]]) -> None:
        for one in self._used:
            roles = {stream.profile.unique_id(): stream.role for stream in one.streams}
            one.sensor.open([stream.profile for stream in one.streams])
            self._running.append(one.sensor)
            one.sensor.start(self._callback(roles, queue))

    def _callback(self, roles: Mapping[int, Role], queue: FrameQueue[tuple[Role, Any, int]]) -> Callable[[Any], None]:
        def take(image: Any) -> None:
            try:
                role = roles.get(image.get_profile().unique_id())
                if role is not None:
                    image.keep()
                    queue.put((role, image, self._clock()))
            except Exception:  # no exception may reach the SDK
                _log.exception("%s: a frame was lost", self.info.uri)

        return take

    def _halt(self) -> None:
        """Stops and closes the running sensors."""
        while self._running:
            sensor = self._running.pop()
            for action in (sensor.stop, sensor.close):
                try:
                    action()
                except RuntimeError:  # a sensor that was not started, or a lost camera
                    continue

    def _pump(self, stop: threading.Event, queue: FrameQueue[tuple[Role, Any, int]]) -> None:
        latest = time.monotonic()
        while not stop.is_set():
            item = queue.take(_POLL_S)
            self._gate.drop("overrun", queue.dropped())
            if item is not None:
                latest = time.monotonic()
                self._deliver(*item)
            elif queue.ended():
                self._gate.report_state(DeviceState.CLOSED, queue.ended())
                return
            elif time.monotonic() - latest > _SILENT_S and not self._is_connected():
                self._gate.report_state(DeviceState.FAILED, "the camera is gone")
                return

    def _is_connected(self) -> bool:
        try:
            return bool(self._camera.is_connected())
        except RuntimeError:
            return False

    def _deliver(self, role: Role, image: Any, t_arrival_ns: int) -> None:
        try:
            picture: Picture = from_frame(self._rs, image)
            made = frame(picture, role, self.cameras[role.sensor].calib_id)
        except (ValueError, RuntimeError):  # librealsense's exceptions for frames, and ours
            self._gate.drop("undecodable")
            return
        if picture.domain != HARDWARE and not self._warned:
            self._warned = True
            self._gate.warn("clock", _NO_METADATA.format(picture.domain))
        stamp = self._clocks[role].stamp(picture.ticks, t_arrival_ns)
        self._gate.deliver_stamped([made], stamp, t_arrival_ns)


def _info(stream: Stream) -> StreamInfo:
    role, profile = stream.role, stream.profile
    size = profile.width(), profile.height()
    return StreamInfo(role.sensor, role.stream, role.kind, stream.encoding, *size, float(profile.fps()), CLOCK)
