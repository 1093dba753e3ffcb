"""Colours: red, green and blue of a vertex are those of the first image."""

from collections.abc import Mapping
from dataclasses import dataclass

from abs_service.pairing.images import ColorImage
from abs_service.tracker.measurements.base import Comparison, Decoder, FirstImages, rgb
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.vertex_values import Values, known
from calib.noise.images.color import GaussianColor
from calib.rig import Sensor
from drivers.contract.frame import Frame, Kind

Noise = GaussianColor


@dataclass(frozen=True)
class Measurement:
    """Images of a colour camera; see `MeasurementKind`."""

    noise: GaussianColor
    frames = (Kind.COLOR,)
    color_rank = 0

    def decoder(self, sensor: Sensor) -> Decoder:
        """Decoder of rgb8 and bgr8."""
        return _decode

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> ColorTerm:
        """Three channels of a vertex."""
        appearance, bounds = mesh.appearance_of(sensor.name), comparison.bounds
        return ColorTerm(sensor.name, synthesizer, appearance, self.noise, bounds, comparison.registration_noise)

    def appearance(self, seen: Values, sensor: Sensor, first: FirstImages) -> Values:
        """The sensor's own values, because no two cameras agree on a colour; else those of other cameras."""
        return known(seen, first.colors)

    def colors(self, seen: Values) -> Values:
        """The colours themselves."""
        return seen


def _decode(frames: Mapping[Kind, Frame]) -> ColorImage:
    needed = "rgb8 or bgr8; monochrome cameras have the noise type grey"
    return ColorImage(rgb(frames[Kind.COLOR], "color", needed))
