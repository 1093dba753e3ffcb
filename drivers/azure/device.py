"""An Azure Kinect as a device.

One thread takes captures, copies their images and delivers those of the depth sensor; another decodes colours, which
takes longer than a period in the largest sizes and may cost no depth, and reports the end when nothing follows.
"""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from calib.camera import Camera
from drivers.azure import controls, library
from drivers.azure.address import Address
from drivers.azure.kinect import Kinect
from drivers.azure.picture import AMPLITUDE, CLOCK, COLOR, DEPTH, ENCODINGS, PASSIVE, Picture, Role, frame, pictures
from drivers.contract.capabilities import Capabilities, StreamInfo
from drivers.contract.clock import DeviceClock, stream_gauges
from drivers.contract.device import DeviceError, DeviceInfo, DeviceState, Sink
from drivers.contract.frame_gate import FrameGate
from drivers.contract.frame_queue import FrameQueue

#: Polling interval of the stop event [ms].
_POLL_MS = 100


@dataclass(slots=True)
class _Counter:
    """Numbers of one head's exposures, by their times: the camera sends none, so gaps in time are losses."""

    period_us: float
    number: int = 0
    last_us: int | None = None

    def missing(self, time_us: int, stepped: bool) -> int:
        """Counts an exposure; number of exposures that are missing before it."""
        begins = self.last_us is None or stepped
        missing = 0 if begins else max(round((time_us - (self.last_us or 0)) / self.period_us) - 1, 0)
        self.number += missing + (self.last_us is not None)
        self.last_us = time_us
        return missing


@dataclass(slots=True, eq=False)
class _Run:
    """Threads and counts from a start to its end.

    Attributes:
        stop: ends the threads.
        clocks, counters: of the heads.
        colors: colours that wait to be decoded, each with its time of arrival [ns].
        threads: of this run.
    """

    stop: threading.Event
    clocks: Mapping[str, DeviceClock]
    counters: Mapping[str, _Counter]
    colors: FrameQueue[tuple[Picture, int]] = field(default_factory=FrameQueue)
    threads: tuple[threading.Thread, ...] = ()


class AzureDevice:
    """Delivers the streams of one camera.

    Args:
        kinect: the open camera.
        address: what is wanted of it.
        info: its identity.
        cameras: its calibration.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        DeviceError: it does not tell the limits of its controls.
    """

    def __init__(
        self,
        kinect: Kinect,
        address: Address,
        info: DeviceInfo,
        cameras: Mapping[str, Camera],
        clock: Callable[[], int],
    ) -> None:
        self.info = info
        self.cameras = cameras
        self._kinect = kinect
        self._clock = clock
        self._mode = address.depth
        self._start = controls.Start(address)
        self.controls = controls.make(kinect, self._start)
        self._roles = _roles(address)
        streams = tuple(_info(role, cameras[role.sensor], address.rate_hz) for role in self._roles)
        self.capabilities = Capabilities(streams, self.controls.infos, controls.sync_roles(address))
        self._gate = FrameGate(streams, causes=["missing", "overrun", "undecodable"])
        self._lock = threading.RLock()
        self._run: _Run | None = None

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered; `missing` by gaps in the time stamps; `overrun`: colours that waited; `undecodable`."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping of each head."""
        run = self._run
        return (
            stream_gauges(((head, _first(self._roles, head)), one) for head, one in run.clocks.items()) if run else {}
        )

    def start(self, sink: Sink) -> None:
        """See `drivers.contract.device.Device.start`."""
        with self._lock:
            stop = self._gate.begin(sink, "starting the camera's streams")
            if stop is None:
                return
            period_us = 1e6 / self._start.address.rate_hz
            heads = dict.fromkeys(role.sensor for role in self._roles)
            clocks = {head: DeviceClock(CLOCK) for head in heads}
            run = _Run(stop, clocks, {head: _Counter(period_us) for head in heads})
            try:
                self._kinect.start(self._start.configuration())
            except DeviceError as error:
                self._gate.report_state(DeviceState.FAILED, str(error))
                raise
            self._start.streams = True
            self._gate.report_state(DeviceState.STREAMING, "images follow")
            self._run = run
            run.threads = tuple(
                threading.Thread(target=self._gate.guard, args=(work, run), name="azure", daemon=True)
                for work in (self._take, self._decode)
            )
            for thread in run.threads:
                thread.start()

    def stop(self) -> None:
        """See `drivers.contract.device.Device.stop`."""
        self._gate.end("stopped")
        with self._lock:
            run = self._run
        # A sink that stops the device holds what the other thread may wait for, so nobody waits then.
        if run is not None and threading.current_thread() not in run.threads:
            for thread in run.threads:
                thread.join()
        with self._lock:
            if self._run is run:
                self._kinect.stop()
                self._start.streams = False

    def close(self) -> None:
        """See `drivers.contract.device.Device.close`."""
        self._gate.release()
        self.stop()
        self._kinect.close()

    def _take(self, run: _Run) -> None:
        library.forget()
        while not run.stop.is_set():
            try:
                capture = self._kinect.capture(_POLL_MS)
            except DeviceError as error:
                run.colors.end(str(error))
                return
            if capture is None:
                continue
            arrival_ns = self._clock()
            try:
                images = list(pictures(self._kinect.sdk, capture, self._roles))
            finally:
                self._kinect.sdk.k4a_capture_release(capture)
            if COLOR in {image.role for image in images}:
                run.colors.put((images.pop(), arrival_ns))  # the last of the roles
            self._deliver(run, images, arrival_ns)

    def _decode(self, run: _Run) -> None:
        while not run.stop.is_set():
            item = run.colors.take(_POLL_MS / 1000)
            overrun = run.colors.dropped()
            self._gate.drop("overrun", overrun)
            if item is not None:
                self._deliver(run, [item[0]], item[1], overrun)
            elif run.colors.ended() and not run.stop.is_set():
                self._gate.report_state(DeviceState.FAILED, run.colors.ended())
                return

    def _deliver(self, run: _Run, images: list[Picture], arrival_ns: int, counted: int = 0) -> None:
        """Delivers images of one exposure of a head; so many before it were counted otherwise."""
        if not images:
            return
        head, time_us = images[0].role.sensor, images[0].time_us
        stamp = run.clocks[head].stamp(time_us, arrival_ns)
        missing = run.counters[head].missing(time_us, stamp.stepped)
        expected = sum(role.sensor == head for role in self._roles)
        self._gate.drop("missing", max(missing - counted, 0) * expected + expected - len(images))
        frames = []
        for image in images:
            try:
                frames.append(frame(image, self.cameras[head], run.counters[head].number, self._mode))
            except ValueError:
                self._gate.drop("undecodable")
        self._gate.deliver_stamped(frames, stamp, arrival_ns)


def _roles(address: Address) -> tuple[Role, ...]:
    depth = (PASSIVE,) if address.is_passive else (DEPTH, AMPLITUDE) if address.amplitude else (DEPTH,)
    return (*(depth if address.depth else ()), *((COLOR,) if address.color else ()))


def _first(roles: tuple[Role, ...], head: str) -> str:
    return next(role.stream for role in roles if role.sensor == head)


def _info(role: Role, camera: Camera, rate_hz: int) -> StreamInfo:
    size = camera.width, camera.height
    return StreamInfo(role.sensor, role.stream, role.kind, ENCODINGS[role.kind], *size, float(rate_hz), CLOCK)
