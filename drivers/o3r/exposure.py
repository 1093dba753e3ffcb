"""One exposure of an O3R: its images and calibration, and the frames they make."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from drivers.contract.capabilities import ClockInfo
from drivers.contract.frame import ENCODINGS, Frame, Geometry, Kind
from drivers.o3r.chunks import ChunkError
from drivers.o3r.tof_info import TofInfo

#: Name of the only sensor.
SENSOR = "depth"
#: The processing unit's clock.
CLOCK = ClockInfo("o3r", 1e9)
#: Kind of the images, by stream name.
KINDS: Mapping[str, Kind] = {
    "depth": Kind.DEPTH,
    "deviation": Kind.DEVIATION,
    "amplitude": Kind.AMPLITUDE,
    "confidence": Kind.CONFIDENCE,
}

_ENCODINGS = {Kind.AMPLITUDE: ("32FC1",), Kind.CONFIDENCE: ("mono8", "mono16")}
#: Values that mean "no return".
_INVALID = {Kind.DEPTH: 0.0, Kind.DEVIATION: 0.0, Kind.AMPLITUDE: -1.0}


@dataclass(frozen=True, slots=True, eq=False)
class Exposure:
    """Contents of one message.

    Attributes:
        number: of the exposure, counted by the head.
        time_ns: the middle of its first partial exposure on the processing unit's clock [ns]; in the example of ifm's
            documentation (Timestamps) it equals the first of the acquisition timestamps, which are those of the middle.
        info: calibration and settings.
        images: by stream name: distances and their deviations in digits of `info.distance_m` or, as floating-point
            numbers, in metres; amplitudes, -1 without return; flags of the confidence.
    """

    number: int
    time_ns: int
    info: TofInfo
    images: Mapping[str, NDArray[np.generic]]

    @property
    def camera(self) -> Camera:
        """Camera of the distances.

        Raises:
            ChunkError: unsupported lens model.
        """
        height, width = self.images["depth"].shape
        return self.info.camera(width, height)

    def frames(self, calib_id: str, mode: str = "") -> Iterator[Frame]:
        """All images, with the processing unit's times in place of the host's.

        Raises:
            ChunkError: an image of an unexpected pixel format.
        """
        for stream, image in self.images.items():
            kind = KINDS[stream]
            is_length, has_digits = kind in {Kind.DEPTH, Kind.DEVIATION}, np.issubdtype(image.dtype, np.integer)
            yield Frame(
                *(SENSOR, stream, kind, image, _encoding(stream, kind, image.dtype)),
                t_host_ns=self.time_ns,
                t_arrival_ns=self.time_ns,
                seq=self.number,
                scale=self.info.distance_m if is_length and has_digits else 1.0,
                geometry=Geometry.RADIAL if kind == Kind.DEPTH else Geometry.NONE,
                invalid=_INVALID.get(kind),
                t_device_ticks=self.time_ns,
                tick_hz=CLOCK.tick_hz,
                clock_domain=CLOCK.domain,
                exposure_s=self.info.exposure_s,
                temperature_c=self.info.temperature_c,
                modulation=mode,
                calib_id=calib_id,
            )


def _encoding(stream: str, kind: Kind, dtype: np.dtype) -> str:
    allowed = _ENCODINGS.get(kind, ("16UC1", "32FC1"))
    for name in allowed:
        if ENCODINGS[name][0] == dtype:
            return name
    raise ChunkError(f"{stream} must be one of {allowed}, not {dtype}")
