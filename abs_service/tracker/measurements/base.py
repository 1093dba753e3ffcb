"""Interface of a kind of measurement, and decoding that several kinds share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Image
from abs_service.pairing.observation import ObservationError
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import Bounds, Term
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_REGISTRATION_NOISE,
    TextureRegistrationNoise,
)
from abs_service.tracker.terms.photometric.vertex_values import Values
from calib.rig import Rig, Sensor
from drivers.contract.frame import Frame, Kind

#: Makes the image of one sensor from the frames of its head, by kind; raises ObservationError if they do not fit.
Decoder = Callable[[Mapping[Kind, Frame]], Image]


@dataclass(frozen=True)
class Comparison:
    """Comparison of images with the mesh, as an objective configures it.

    Attributes:
        bounds: costs of the outlier model.
        registration_noise: of the texture.
        outline_px: standard deviation of the outline in a depth image; 0 for no outline.
        ragged_outline_px: the largest of an outline that is seen to be ragged; 0 if it does not change.
    """

    bounds: Bounds
    registration_noise: TextureRegistrationNoise = NO_REGISTRATION_NOISE
    outline_px: float = 0.0
    ragged_outline_px: float = 0.0


class MeasurementKind(Protocol):
    """Measurements of one kind under one noise model."""

    @property
    def frames(self) -> tuple[Kind, ...]:
        """Kinds of frames that an image is decoded from; the first one gives the exposure."""
        ...

    def decoder(self, sensor: Sensor) -> Decoder:
        """The decoder for one sensor."""
        ...

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> Term:
        """Term of one sensor for a mesh with its appearance, under this noise model."""
        ...


@dataclass(frozen=True)
class FirstImages:
    """The images from which the appearance is made.

    Attributes:
        mesh: the mesh at their time.
        images: by sensor.
        rig: the sensors.
        colors: red, green, blue (n, 3) of the vertices in 0…255 from all sensors; NaN where unknown.
    """

    mesh: Mesh
    images: Mapping[str, Image]
    rig: Rig
    colors: Values


class PictureKind(MeasurementKind, Protocol):
    """Measurements of the surface's appearance; their noise is an `ImageNoise`."""

    def appearance(self, seen: Values, sensor: Sensor, first: FirstImages) -> Values:
        """Appearance (n, channels) of the vertices in one sensor, NaN where unknown.

        Args:
            seen: values of the sensor's own first image at the vertices (n, channels), NaN where it shows none.
            sensor: the sensor.
            first: all first images.
        """
        ...


@runtime_checkable
class ColorKind(Protocol):
    """Images from which the vertices take their colours.

    Attributes:
        color_rank: pictures of a higher rank count only for vertices that none of a lower rank shows.
    """

    color_rank: int

    def colors(self, seen: Values) -> Values:
        """Red, green, blue (n, 3) in 0…255 for values at the vertices (n, channels)."""
        ...


def rgb(frame: Frame, noise: str, needed: str) -> NDArray[np.uint8]:
    """Red, green, blue (height, width, 3) of a colour frame.

    Raises:
        ObservationError: it is none; the message names the `type` of the noise model and what that needs.
    """
    if frame.encoding not in {"rgb8", "bgr8"}:
        raise wrong_encoding(frame, noise, needed)
    pixels = frame.data.view(np.uint8)
    return pixels[..., ::-1] if frame.encoding == "bgr8" else pixels


def wrong_encoding(frame: Frame, noise: str, needed: str) -> ObservationError:
    """Error about a frame that a noise model of type `noise` cannot be used for."""
    return ObservationError(
        f"{frame.sensor}/{frame.stream} is {frame.encoding}, but sensors.{frame.sensor} has noise of type {noise}, "
        f"which needs {needed}"
    )
