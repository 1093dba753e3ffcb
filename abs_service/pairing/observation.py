"""Observations: one decoded image per sensor, of one moment."""

from dataclasses import dataclass

from abs_service.pairing.images import Image
from calib.camera import Camera
from drivers.contract.frame import Frame


class ObservationError(ValueError):
    """A frame that does not match the rig's configuration."""


@dataclass(frozen=True, slots=True)
class Source:
    """Exposure of an image of the observation: number, time and standard deviation of the time [ns]."""

    seq: int
    t_host_ns: int
    t_sigma_ns: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """All measurements of a rig at one moment.

    Attributes:
        seq: number of the frame set.
        t_host_ns: the moment, CLOCK_MONOTONIC [ns].
        images: image of every sensor that contributed.
        sources: the exposure each image comes from.
        missing: sensors without an image.
    """

    seq: int
    t_host_ns: int
    images: dict[str, Image]
    sources: dict[str, Source]
    missing: tuple[str, ...]


def check_size(frame: Frame, camera: Camera) -> None:
    """Refuses a frame of another size than the images of its sensor's camera.

    Raises:
        ObservationError: names both sizes.
    """
    height, width = frame.data.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise ObservationError(
            f"{frame.sensor}/{frame.stream} is {width} × {height} pixels, but the camera model of "
            f"sensors.{frame.sensor} is for {camera.width} × {camera.height}"
        )
