"""Interface of heads, and the data of one exposure."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.capabilities import ClockInfo, StreamInfo
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.scene.scene import Moment

#: Exposure time of colour heads that shows colours as they are [s].
NOMINAL_S = 0.01

#: Clock of the simulated device; it counts from the first exposure.
CLOCK = ClockInfo("simulated", 1e9)


@dataclass(frozen=True, eq=False)
class Exposure:
    """Input of a head for one exposure.

    Attributes:
        seq: number of the exposure.
        moment: all bodies.
        generator: random generator of this head's noise in this exposure.
        t_ns: time since the first exposure [ns].
        jitter_ns: error of the timestamp [ns].
        t_sigma_ns: standard deviation of that error [ns].
        color_s: exposure time of colour heads [s].
    """

    seq: int
    moment: Moment
    generator: np.random.Generator
    t_ns: int
    jitter_ns: int = 0
    t_sigma_ns: int = 0
    color_s: float = NOMINAL_S

    @property
    def brightness(self) -> float:
        """Factor on the light that a colour head measures."""
        return self.color_s / NOMINAL_S

    def frame(
        self,
        stream: StreamInfo,
        camera: Camera,
        data: NDArray[np.generic],
        scale: float = 1.0,
        geometry: Geometry = Geometry.NONE,
        invalid: float | None = None,
        exposure_s: float = math.nan,
    ) -> Frame:
        """A frame of this exposure; times and ticks are relative to the first exposure."""
        return Frame(
            sensor=stream.sensor,
            stream=stream.stream,
            kind=stream.kind,
            data=data,
            encoding=stream.encoding,
            t_host_ns=self.t_ns + self.jitter_ns,
            t_arrival_ns=self.t_ns,
            seq=self.seq,
            scale=scale,
            geometry=geometry,
            invalid=invalid,
            t_device_ticks=self.t_ns,
            tick_hz=CLOCK.tick_hz,
            clock_domain=CLOCK.domain,
            t_sigma_ns=self.t_sigma_ns,
            calib_id=camera.calib_id,
            exposure_s=exposure_s,
        )


class Head(Protocol):
    """One optical head of the simulated device."""

    @property
    def camera(self) -> Camera:
        """True camera model, which is also the factory calibration."""
        ...

    @property
    def streams(self) -> tuple[StreamInfo, ...]:
        """Streams of the head."""
        ...

    def expose(self, exposure: Exposure) -> list[Frame]:
        """The frames of one exposure; a pure function of it."""
        ...


def stream_of(sensor: str, stream: str, kind: Kind, encoding: str, camera: Camera, rate_hz: float) -> StreamInfo:
    """The stream of a head whose images have the camera's size."""
    return StreamInfo(sensor, stream, kind, encoding, camera.width, camera.height, rate_hz, CLOCK)
