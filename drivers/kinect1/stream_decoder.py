"""Decodes the packets of one stream into frames."""

import math
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.capabilities import ClockInfo, StreamInfo
from drivers.contract.clock import DeviceClock, Stamp, stream_gauges
from drivers.contract.frame import Frame, Geometry, Kind, Reference
from drivers.kinect1 import unpacking
from drivers.kinect1.assembly import MAX_GAP, Assembler, RawImage
from drivers.kinect1.camera import Stream
from drivers.kinect1.reference_plane import DEPTH_SCALE, ReferencePlane
from drivers.kinect1.transport.packets import TICK_HZ
from drivers.kinect1.transport.transfer import Transfer

_STREAMS = {
    Stream.DEPTH: ("depth", "depth", Kind.DEPTH, "16UC1"),
    Stream.COLOR: ("color", "bayer", Kind.BAYER, "bayer_grbg8"),
    Stream.IR: ("ir", "ir", Kind.IR, "mono16"),
}


def stream_info(stream: Stream, serial: str) -> StreamInfo:
    """Properties of a stream; all streams of a camera share one clock."""
    clock = ClockInfo(f"kinect1 {serial}", TICK_HZ, bits=32)
    return StreamInfo(*_STREAMS[stream], stream.form.width, stream.form.height, stream.form.rate_hz, clock)


def camera_of(stream: Stream, plane: ReferencePlane) -> Camera:
    """Camera model of a stream. The rig's frame is that of the depth camera.

    Depth has 480 rows and is computed from infra-red images of 488, so they have different camera models.
    """
    return plane.color_camera() if stream == Stream.COLOR else plane.depth_camera(stream.form.height)


class StreamDecoder:
    """Decoder of one stream.

    Args:
        stream: the stream.
        serial: of the camera.
        plane: its calibration.
        exposure_s: the exposure time [s], NaN if unknown.
    """

    def __init__(
        self, stream: Stream, serial: str, plane: ReferencePlane, exposure_s: Callable[[], float] = lambda: math.nan
    ) -> None:
        self.info = stream_info(stream, serial)
        self._stream = stream
        self._exposure_s = exposure_s
        self._table = plane.table()
        self._calib_id = camera_of(stream, plane).calib_id
        # Only depth has a value for pixels without a measurement.
        self._assembler = Assembler(stream.form, MAX_GAP if stream == Stream.DEPTH else 0)
        self._incomplete = 0
        self._clock = DeviceClock(self.info.clock)

    @property
    def dropped(self) -> Mapping[str, int]:
        """See `Assembler.dropped`."""
        return self._assembler.dropped

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping, and numbers of lost packets and of images that were delivered without some."""
        return {
            **stream_gauges([(self.info.key, self._clock)]),
            f"{self.info.stream}.missing_packets": float(self._assembler.missing),
            f"{self.info.stream}.incomplete_images": float(self._incomplete),
        }

    def decode(self, transfer: Transfer) -> Iterator[tuple[Frame, Stamp]]:
        """Frames that a transfer completes, without host times, and the stamps with these."""
        for image in self._assembler.feed(transfer.packets, transfer.lengths):
            # The timestamp is that of the first packet; the last one arrives a period later.
            stamp = self._clock.stamp(image.ticks, transfer.arrival_ns(image.row))
            is_depth = self._stream == Stream.DEPTH
            self._incomplete += bool(image.gone)
            frame = Frame(
                sensor=self.info.sensor,
                stream=self.info.stream,
                kind=self.info.kind,
                data=self._pixels(image),
                encoding=self.info.encoding,
                t_host_ns=0,
                t_arrival_ns=0,
                seq=image.seq,
                scale=DEPTH_SCALE if is_depth else 1.0,
                geometry=Geometry.Z if is_depth else Geometry.NONE,
                invalid=0 if is_depth else None,
                t_device_ticks=image.ticks,
                tick_hz=TICK_HZ,
                clock_domain=self.info.clock.domain,
                t_reference=Reference.END,
                exposure_s=self._exposure_s(),
                calib_id=self._calib_id,
                incomplete=bool(image.gone),
            )
            yield frame, stamp

    def _pixels(self, image: RawImage) -> NDArray[np.generic]:
        form = self._stream.form
        match self._stream:
            case Stream.DEPTH:
                depth = unpacking.depth(image.data, self._table, form.height, form.width)
                for place in image.gone:
                    depth.reshape(-1)[form.pixels(place)] = 0
                return depth
            case Stream.IR:
                return unpacking.infrared(image.data, form.height, form.width)
        return image.data.reshape(form.height, form.width).copy()
