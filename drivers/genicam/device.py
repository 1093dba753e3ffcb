"""A GenICam camera as a device: one thread starts the camera, takes its images and stops it."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from calib.camera import Camera
from drivers.contract.capabilities import HOST_CLOCK, Capabilities, ClockInfo, StreamInfo
from drivers.contract.clock import DeviceClock, Stamp, stream_gauges
from drivers.contract.device import DeviceError, DeviceInfo, DeviceState, Sink
from drivers.contract.frame import Frame, Kind
from drivers.contract.frame_gate import FrameGate
from drivers.genicam import controls, features, pixels
from drivers.genicam.features import Distances
from drivers.genicam.link import CameraLink, Shot

#: Interval at which images are looked for [s].
_POLL_S = 0.002
#: Numbers of GigE Vision's images of 16 bits, of which 0 is none.
_NUMBERS = 65535


@dataclass(frozen=True, slots=True, eq=False)
class First:
    """The first exposure after opening, from which the streams follow."""

    shot: Shot
    distances: Distances
    camera: Camera
    rate_hz: float


class GenicamDevice:
    """Delivers the images of one camera.

    Args:
        link: to the camera, which is closed with the device.
        info: its identity.
        first: one of its exposures.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        PixelError: an unsupported pixel format.
    """

    def __init__(self, link: CameraLink, info: DeviceInfo, first: First, clock: Callable[[], int]) -> None:
        self.info = info
        self.controls = controls.make(link)
        self.cameras: Mapping[str, Camera] = {pixels.SENSOR: first.camera}
        self._link = link
        self._clock = clock
        self._ticks = HOST_CLOCK if first.shot.time_ns is None else ClockInfo("genicam", 1e9)
        self._calib_id = first.camera.calib_id
        frames = pixels.frames(first.shot, first.distances, self._calib_id, float("nan"))
        streams = tuple(_info(frame, first.rate_hz, self._ticks) for frame in frames)
        self.capabilities = Capabilities(streams, self.controls.infos)
        self._gate = FrameGate(streams, causes=["missing", "undecodable"])
        self._lock = threading.Lock()
        self._thread = threading.Thread()
        self._mapping: DeviceClock | None = None

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `missing`: never came or incomplete, by the camera's numbers; `undecodable`."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping, which all streams share; none without the camera's time stamps."""
        mapping = self._mapping
        return stream_gauges([] if mapping is None else [((pixels.SENSOR, "depth"), mapping)])

    def start(self, sink: Sink) -> None:
        """See `drivers.contract.device.Device.start`."""
        with self._lock:
            stop = self._gate.begin(sink, "starting the camera")
            if stop is None:
                return
            if self._thread is threading.current_thread():
                self._link.stop()  # the last run's sink begins this one
            elif self._thread.is_alive():
                self._thread.join()  # the last run, which was stopped by the sink itself
            try:
                self._link.start()
            except DeviceError as error:
                self._gate.report_state(DeviceState.FAILED, str(error))
                raise
            self._mapping = DeviceClock(self._ticks) if self._ticks.tick_hz else None
            self._gate.report_state(DeviceState.STREAMING, "images follow")
            self._thread = threading.Thread(
                target=self._gate.guard, args=(self._pump, stop), name="genicam", daemon=True
            )
            self._thread.start()

    def stop(self) -> None:
        """See `drivers.contract.device.Device.stop`."""
        self._gate.end("stopped")
        thread = self._thread
        if thread.is_alive() and thread is not threading.current_thread():
            thread.join()

    def close(self) -> None:
        """See `drivers.contract.device.Device.close`."""
        self._gate.release()
        self.stop()
        self._link.close()

    def _pump(self, stop: threading.Event) -> None:
        run = _Run()
        try:
            while not stop.is_set():
                shot = self._link.take()
                if shot is None:
                    stop.wait(_POLL_S)
                else:
                    self._deliver(run, shot, self._clock())
        finally:
            if self._thread is threading.current_thread():  # its sink has begun no other run
                self._link.stop()

    def _deliver(self, run: "_Run", shot: Shot, t_arrival_ns: int) -> None:
        count = len(self.capabilities.streams)
        self._gate.drop("missing", run.count(shot.number) * count)
        with self._link.translated_errors():
            nodes = self._link.nodes
            if run.distances is None:  # controls may have changed them
                run.distances = features.distances(nodes, self.info.uri)
            exposure_s = controls.exposure_s(nodes)
        try:
            made = list(pixels.frames(replace(shot, number=run.seq), run.distances, self._calib_id, exposure_s))
        except pixels.PixelError:
            self._gate.drop("undecodable", count)
            return
        if shot.time_ns is None or self._mapping is None:
            stamp = Stamp(t_arrival_ns, 0, stepped=False)
        else:
            stamp = self._mapping.stamp(shot.time_ns, t_arrival_ns)
        self._gate.deliver_stamped(made, stamp, t_arrival_ns)


class _Run:
    """State of one run.

    Attributes:
        distances: their meaning, None before the first image.
        seq: number of the latest exposure, which only grows.
    """

    def __init__(self) -> None:
        self.distances: Distances | None = None
        self._latest: int | None = None
        self.seq = 0

    def count(self, number: int) -> int:
        """Takes the camera's number of the next exposure; returns how many are missing before it."""
        step = number - (number - 1 if self._latest is None else self._latest)
        if step <= 0:  # they have begun anew
            step = step % _NUMBERS or 1
        self._latest = number
        self.seq += step
        return step - 1


def _info(frame: Frame, rate_hz: float, clock: ClockInfo) -> StreamInfo:
    height, width = frame.data.shape[:2]
    noisy = frame.kind != Kind.CONFIDENCE  # which may have few values
    return StreamInfo(*frame.key, frame.kind, frame.encoding, width, height, rate_hz, clock, noisy)
