"""Decoders from the frames of a head to the image of a sensor, one per kind of measurement."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import LUMA, BeamReading, ChannelImage, ColorImage, DepthImage, Image
from calib.noise.base import DepthNoise
from calib.noise.bayer import GaussianBayer
from calib.noise.binary import LightBarrier
from calib.noise.color import GaussianColor
from calib.noise.grey import GaussianGrey
from calib.noise.intensity import GaussianIntensity
from calib.noise.measured import Measured
from calib.noise.per_pixel import PerPixel
from calib.rig import Noise, Sensor
from drivers.contract.frame import Frame, Geometry, Kind

#: Channel pattern of a single-channel image, and those of the Bayer mosaics by name.
ONE_CHANNEL = np.zeros((1, 1), np.uint8)
BAYER_ORDERS: Mapping[str, NDArray[np.uint8]] = {
    order: np.array(["rgb".index(letter) for letter in order], np.uint8).reshape(2, 2)
    for order in ("rggb", "bggr", "grbg", "gbrg")
}


class ObservationError(ValueError):
    """A frame that does not match the rig's configuration."""


class Decoder(Protocol):
    """Decodes the frames of a head to the image of one sensor."""

    def decode(self, frames: Mapping[Kind, Frame]) -> Image:
        """The image.

        Raises:
            ObservationError: a frame's encoding does not match the sensor's noise model.
        """
        ...


def kinds(noise: Noise) -> tuple[Kind, ...]:
    """Kinds of frames that a noise model needs; the first one gives the exposure."""
    match noise:
        case DepthNoise():
            return (Kind.DEPTH, *_auxiliary(noise))
        case GaussianColor() | GaussianGrey():
            return (Kind.COLOR,)
        case GaussianBayer():
            return (Kind.BAYER,)
        case GaussianIntensity():
            return (Kind(noise.stream),)
        case LightBarrier():
            return (Kind.BINARY,)


def _auxiliary(noise: DepthNoise) -> tuple[Kind, ...]:
    """Kinds of frames that a depth noise model needs besides the distance."""
    match noise:
        case PerPixel():
            return _auxiliary(noise.law)
        case Measured():
            return (Kind.DEVIATION,)
    return (Kind.AMPLITUDE,) if noise.uses_amplitude else ()


def decoder(sensor: Sensor) -> Decoder:
    """The decoder for the measurements of a sensor's noise model."""
    match sensor.noise:
        case DepthNoise() as noise:
            return _DepthDecoder(sensor, _auxiliary(noise))
        case GaussianColor():
            return _ColorDecoder()
        case GaussianGrey():
            return _GreyDecoder()
        case GaussianBayer():
            return _BayerDecoder()
        case GaussianIntensity():
            return _IntensityDecoder(Kind(sensor.noise.stream))
        case LightBarrier():
            return _BeamDecoder()


class _DepthDecoder:
    def __init__(self, sensor: Sensor, auxiliary: tuple[Kind, ...]):
        self._auxiliary = auxiliary
        # Radial distance per unit of what the frame holds, and what is added: conversion from z, less the depth terms.
        gain = 1 / (1 + sensor.depth_scale)
        self._per_z = (gain * sensor.camera.lookup.ray_length).astype(np.float32)
        self._per_radial = np.float32(gain)
        self._offset = np.float32(-gain * sensor.depth_offset)

    def decode(self, frames: Mapping[Kind, Frame]) -> DepthImage:
        depth = frames[Kind.DEPTH]
        gain = self._per_z if depth.geometry == Geometry.Z else self._per_radial
        distance = depth.si() * gain + self._offset
        return DepthImage(distance, self._amplitude(frames, gain, distance.shape))

    def _amplitude(
        self, frames: Mapping[Kind, Frame], gain: NDArray[np.float32] | np.float32, shape: tuple[int, ...]
    ) -> NDArray[np.float32]:
        """Auxiliary input of the noise model: σ, scaled like the distance, or the amplitude; NaN if there is none."""
        if Kind.DEVIATION in self._auxiliary:
            return frames[Kind.DEVIATION].si() * gain
        return frames[Kind.AMPLITUDE].si() if Kind.AMPLITUDE in frames else np.full(shape, np.nan, np.float32)


class _ColorDecoder:
    def decode(self, frames: Mapping[Kind, Frame]) -> ColorImage:
        needed = "rgb8 or bgr8; monochrome cameras have the noise type grey"
        return ColorImage(_rgb(frames[Kind.COLOR], "color", needed))


class _GreyDecoder:
    """Grey values, or the luma of colours."""

    def decode(self, frames: Mapping[Kind, Frame]) -> ChannelImage:
        frame = frames[Kind.COLOR]
        match frame.encoding:
            case "mono8":
                return ChannelImage(frame.si(), ONE_CHANNEL)
            case "mono16":
                return ChannelImage(frame.si() * np.float32(255 / 65535), ONE_CHANNEL)
        return ChannelImage(_rgb(frame, "grey", "mono8, mono16, rgb8 or bgr8") @ LUMA, ONE_CHANNEL)


class _BayerDecoder:
    def decode(self, frames: Mapping[Kind, Frame]) -> ChannelImage:
        frame = frames[Kind.BAYER]
        order = frame.encoding.removeprefix("bayer_").removesuffix("8")
        if order not in BAYER_ORDERS:
            raise _wrong_encoding(frame, "bayer", "bayer_rggb8, bayer_bggr8, bayer_grbg8 or bayer_gbrg8")
        return ChannelImage(frame.si(), BAYER_ORDERS[order])


class _IntensityDecoder:
    def __init__(self, kind: Kind):
        self._kind = kind

    def decode(self, frames: Mapping[Kind, Frame]) -> ChannelImage:
        return ChannelImage(frames[self._kind].si(), ONE_CHANNEL)


class _BeamDecoder:
    def decode(self, frames: Mapping[Kind, Frame]) -> BeamReading:
        return BeamReading(bool(frames[Kind.BINARY].si().max() > 0.5))


def _rgb(frame: Frame, noise: str, needed: str) -> NDArray[np.uint8]:
    if frame.encoding not in {"rgb8", "bgr8"}:
        raise _wrong_encoding(frame, noise, needed)
    pixels = frame.data.view(np.uint8)
    return pixels[..., ::-1] if frame.encoding == "bgr8" else pixels


def _wrong_encoding(frame: Frame, noise: str, needed: str) -> ObservationError:
    return ObservationError(
        f"{frame.sensor}/{frame.stream} is {frame.encoding}, but sensors.{frame.sensor} has noise of type {noise}, "
        f"which needs {needed}"
    )
