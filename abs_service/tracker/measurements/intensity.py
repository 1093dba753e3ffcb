"""Amplitudes, intensities and infra-red: a reflectivity of the vertex, in the sensor's own light or in the room's."""

from dataclasses import dataclass

import numpy as np

from abs_service.pairing.images import ONE_CHANNEL, ChannelImage
from abs_service.tracker.measurements.base import Comparison, Decoder, FirstImages
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.illumination import Active, Passive, lambert
from abs_service.tracker.terms.photometric.vertex_values import Values
from calib.camera import Camera
from calib.noise.images.intensity import GaussianIntensity
from calib.rig import Sensor
from drivers.contract.frame import Kind

Noise = GaussianIntensity

#: Smallest cosine of incidence from which a reflectivity is estimated.
MIN_COSINE = 0.2


@dataclass(frozen=True)
class Measurement:
    """Images of reflected light; see `MeasurementKind`."""

    noise: GaussianIntensity

    @property
    def frames(self) -> tuple[Kind, ...]:
        """The stream of the noise model."""
        return (Kind(self.noise.stream),)

    def decoder(self, sensor: Sensor) -> Decoder:
        """Decoder to values in the units of the stream."""
        kind = self.frames[0]
        return lambda frames: ChannelImage(frames[kind].si(), ONE_CHANNEL)

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> ChannelTerm:
        """The reflectivity of a vertex in this light."""
        light = Active(sensor.camera.center) if self.noise.illumination == "active" else Passive()
        appearance, bounds = mesh.appearance_of(sensor.name), comparison.bounds
        return ChannelTerm(
            sensor.name, synthesizer, appearance, self.noise, light, bounds, comparison.registration_noise
        )

    def appearance(self, seen: Values, sensor: Sensor, first: FirstImages) -> Values:
        """The sensor's own values, per unit of its own light if it has one."""
        return seen / _brightness(sensor.camera, first.mesh) if self.noise.illumination == "active" else seen


def _brightness(camera: Camera, mesh: Mesh) -> Values:
    """Lambert's factor (n, 1) of the vertices for a lamp at the camera; NaN where it is too small to divide by."""
    surface = Surface(*(np.ascontiguousarray(part.T[None], np.float32) for part in (mesh.vertices, mesh.normals)))
    shade = lambert(surface, camera.center)[0].astype(np.float64)
    cosine = shade * np.sum((mesh.vertices - camera.center) ** 2, axis=1)
    return np.where(cosine > MIN_COSINE, shade, np.nan)[:, None]
