"""Distances from the camera centre, under any noise model of distances."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Parts, Window
from abs_service.tracker.measurements.base import Comparison, Decoder
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.depth.outline.base import NoOutline, Outline
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.measured import Measured
from calib.noise.per_pixel import PerPixel
from calib.noise.scaled import Scaled
from calib.rig import Sensor
from drivers.contract.frame import Frame, Geometry, Kind

Noise = DepthNoise


@dataclass(frozen=True)
class Measurement:
    """Depth images; see `MeasurementKind`."""

    noise: DepthNoise

    @property
    def frames(self) -> tuple[Kind, ...]:
        """The distances, and the other inputs of the noise model."""
        return (Kind.DEPTH, *_auxiliary(self.noise))

    def decoder(self, sensor: Sensor) -> Decoder:
        """Radial distances, less the sensor's depth terms."""
        return _DepthDecoder(sensor, _auxiliary(self.noise)).decode

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> DepthTerm:
        """Distances, the outline at the mesh's rim, and the surface beyond it."""
        return DepthTerm(sensor.name, synthesizer, mesh, self.noise, comparison.bounds, _outline(mesh, comparison))


def _auxiliary(noise: DepthNoise) -> tuple[Kind, ...]:
    """Kinds of frames that a depth noise model needs besides the distance."""
    match noise:
        case PerPixel() | Scaled():
            return _auxiliary(noise.model)
        case Measured():
            return (Kind.DEVIATION,)
    return (Kind.AMPLITUDE,) if noise.uses_amplitude else ()


def _outline(mesh: Mesh, comparison: Comparison) -> Callable[[Camera], Outline]:
    if not comparison.outline_px:
        return lambda camera: NoOutline()
    return partial(RimOutline, rim=Rim.of(mesh), deviation=comparison.outline_px, ragged=comparison.ragged_outline_px)


class _DepthDecoder:
    def __init__(self, sensor: Sensor, auxiliary: tuple[Kind, ...]):
        self._auxiliary = auxiliary
        # Radial distance per unit of what the frame holds, and what is added: conversion from z, less the depth terms.
        gain = 1 / (1 + sensor.depth_scale)
        self._per_z = (gain * sensor.camera.lookup.ray_length).astype(np.float32)
        self._per_radial = np.float32(gain)
        self._offset = np.float32(-gain * sensor.depth_offset)

    def decode(self, frames: Mapping[Kind, Frame]) -> DepthImage:
        height, width = frames[Kind.DEPTH].data.shape
        return DepthImage.deferred((height, width), partial(self._part, frames))

    def _part(self, frames: Mapping[Kind, Frame], window: Window) -> Parts:
        """Distances and amplitudes in a window of the image."""
        depth = frames[Kind.DEPTH]
        gain = self._per_z[window] if depth.geometry == Geometry.Z else self._per_radial
        distance = depth.si(*window)
        distance *= gain
        distance += self._offset
        return distance, self._amplitude(frames, gain, window, distance.shape)

    def _amplitude(
        self,
        frames: Mapping[Kind, Frame],
        gain: NDArray[np.float32] | np.float32,
        window: Window,
        shape: tuple[int, ...],
    ) -> NDArray[np.float32]:
        """Auxiliary input of the noise model: σ, scaled like the distance, or the amplitude; NaN if there is none."""
        if Kind.DEVIATION in self._auxiliary:
            return frames[Kind.DEVIATION].si(*window) * gain
        return frames[Kind.AMPLITUDE].si(*window) if Kind.AMPLITUDE in frames else np.full(shape, np.float32(np.nan))
