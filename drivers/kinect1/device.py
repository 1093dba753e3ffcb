"""An opened Kinect as a device: one thread reads and delivers its streams."""

import math
import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities
from drivers.contract.controls import Control, ControlInfo, ControlKind, Controls, Value
from drivers.contract.device import DeviceError, DeviceInfo, DeviceState, Sink
from drivers.contract.frame_gate import FrameGate
from drivers.kinect1.assembly import CAUSES
from drivers.kinect1.camera import LINE_S, MAX_LINES, KinectCamera, Stream
from drivers.kinect1.color_settings import ColorSettings
from drivers.kinect1.stream_decoder import StreamDecoder, camera_of, stream_info
from drivers.kinect1.transport.commands import Commands
from drivers.kinect1.transport.image_losses import ImageLosses
from drivers.kinect1.transport.port import Port

#: Read timeout, and so the polling interval of the stop event [s].
_READ_TIMEOUT_S = 0.1


class Kinect1Device:
    """Delivers `depth/depth` (z), and raw `color/bayer` or `ir/ir`.

    Args:
        info: its identity.
        streams: streams to deliver.
        port: of the camera; closed with the device.
        clock: CLOCK_MONOTONIC [ns].
        sleep: waits [s].

    Raises:
        DeviceError: the camera does not answer, or its calibration is invalid.
    """

    def __init__(
        self,
        info: DeviceInfo,
        streams: tuple[Stream, ...],
        port: Port,
        clock: Callable[[], int],
        sleep: Callable[[float], object],
    ) -> None:
        self._port = port
        self._clock = clock
        self._camera = KinectCamera(Commands(port, clock, sleep))
        self._streams = streams
        self._plane = self._camera.reference_plane()
        self.info = info
        infos = tuple(stream_info(stream, info.serial) for stream in streams)
        self._gate = FrameGate(infos, CAUSES)
        # Nothing that the device holds refers to it: the handles of USB go with the last reference.
        self._colors = ColorSettings(self._camera, self._gate.warn)
        self.controls = _controls(self._camera, streams, self._colors.read)
        self.capabilities = Capabilities(infos, self.controls.infos)
        self.cameras: Mapping[str, Camera] = {
            described.sensor: camera_of(stream, self._plane)
            for stream, described in zip(streams, self.capabilities.streams)
        }
        self._decoders: Mapping[int, StreamDecoder] = {}
        self._thread = threading.Thread()

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames` delivered, and dropped images of all streams by `CAUSES`."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mappings of the streams, and numbers of lost packets since the last start."""
        return {name: value for decoder in self._decoders.values() for name, value in decoder.gauges.items()}

    def start(self, sink: Sink) -> None:
        """Starts delivery in a new epoch; no effect while it is running.

        Raises:
            DeviceError: the device was closed.
        """
        if stop := self._gate.begin(sink, "beginning the camera's streams"):
            arguments = self._run, stop, self._thread
            self._thread = threading.Thread(target=self._gate.guard, args=arguments, name="kinect1", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stops delivery; the sink is not called after it returns."""
        self._gate.end("stopped")
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join()

    def close(self) -> None:
        """Stops and releases the camera."""
        self._gate.release()
        self.stop()
        self._port.close()

    def _run(self, stop: threading.Event, before: threading.Thread) -> None:
        if before.is_alive():
            before.join()  # stopped in its own sink
        self._stream(stop)

    def _stream(self, stop: threading.Event) -> None:
        exposures = {Stream.COLOR: self._colors.exposure_s}
        decoders = {
            stream.form.endpoint: StreamDecoder(stream, self.info.serial, self._plane, exposures.get(stream, _unknown))
            for stream in self._streams
        }
        self._decoders = decoders
        counted = dict.fromkeys(CAUSES, 0)
        losses = ImageLosses(self._clock, self._gate.warn)
        delivered = 0

        def count() -> None:
            for cause in CAUSES:
                total = sum(decoder.dropped[cause] for decoder in decoders.values())
                self._gate.drop(cause, total - counted[cause])
                counted[cause] = total

        with ExitStack() as ending:
            ending.callback(count)
            reader = ending.enter_context(self._port.reading(tuple(decoders)))
            for stream in self._streams:
                ending.callback(self._end, stream)
                self._camera.start(stream)
            if Stream.COLOR in self._streams:
                self._colors.read()
            self._gate.report_state(DeviceState.STREAMING, "the camera delivers")
            while not stop.is_set():
                for transfer in reader.read(_READ_TIMEOUT_S):
                    if stop.is_set():
                        return
                    for frame, stamp in decoders[transfer.endpoint].decode(transfer):
                        self._gate.deliver_stamped([frame], stamp, transfer.t_ns)
                        delivered += 1
                count()
                losses.update(delivered, sum(counted.values()))

    def _end(self, stream: Stream) -> None:
        with suppress(DeviceError):  # it may be gone
            self._camera.stop(stream)


def _unknown() -> float:
    return math.nan


def _controls(camera: KinectCamera, streams: tuple[Stream, ...], changed: Callable[[], None]) -> Controls:
    def then_read(write: Callable[[Value], None]) -> Callable[[Value], None]:
        def written(value: Value) -> None:
            write(value)
            changed()

        return written

    controls = [
        Control(
            ControlInfo("infrared_gain", ControlKind.WHOLE, minimum=1, maximum=50),
            camera.infrared_gain,
            lambda value: camera.set_infrared_gain(int(value)),
        )
    ]
    if Stream.COLOR in streams:
        limits = {"unit": "s", "minimum": LINE_S, "maximum": MAX_LINES * LINE_S}
        controls += [
            Control(
                ControlInfo("exposure_s", ControlKind.NUMBER, **limits),
                camera.exposure_s,
                then_read(lambda value: camera.set_exposure_s(float(value))),
            ),
            Control(
                ControlInfo("auto_exposure", ControlKind.SWITCH),
                camera.auto_exposure,
                then_read(lambda value: camera.set_auto_exposure(bool(value))),
            ),
            Control(
                ControlInfo("auto_white_balance", ControlKind.SWITCH),
                camera.auto_white_balance,
                then_read(lambda value: camera.set_auto_white_balance(bool(value))),
            ),
        ]
    return Controls(controls)
