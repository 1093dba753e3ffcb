"""Grey values: those of a monochrome camera, or the luma of a colour camera."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from abs_service.pairing.images import LUMA, ONE_CHANNEL, ChannelImage
from abs_service.tracker.measurements.base import Comparison, Decoder, FirstImages, rgb
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.illumination import Exposed
from abs_service.tracker.terms.photometric.vertex_values import Values, known
from calib.noise.images.grey import GaussianGrey
from calib.rig import Sensor
from drivers.contract.frame import Frame, Kind

Noise = GaussianGrey


@dataclass(frozen=True)
class Measurement:
    """Grey images; see `MeasurementKind`."""

    noise: GaussianGrey
    frames = (Kind.COLOR,)
    color_rank = 2

    def decoder(self, sensor: Sensor) -> Decoder:
        """Decoder of mono8, mono16, rgb8 and bgr8, to 0…255."""
        return _decode

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> ChannelTerm:
        """One channel of a vertex."""
        appearance, bounds = mesh.appearance_of(sensor.name), comparison.bounds
        return ChannelTerm(
            sensor.name, synthesizer, appearance, self.noise, Exposed(), bounds, comparison.registration_noise
        )

    def appearance(self, seen: Values, sensor: Sensor, first: FirstImages) -> Values:
        """The sensor's own values; else the luma of other cameras' colours."""
        return known(seen, first.colors @ LUMA[:, None])

    def colors(self, seen: Values) -> Values:
        """Three times the grey value."""
        return np.repeat(seen, 3, axis=1)


def _decode(frames: Mapping[Kind, Frame]) -> ChannelImage:
    frame = frames[Kind.COLOR]
    match frame.encoding:
        case "mono8":
            return ChannelImage(frame.si(), ONE_CHANNEL)
        case "mono16":
            return ChannelImage(frame.si() * np.float32(255 / 65535), ONE_CHANNEL)
    return ChannelImage(rgb(frame, "grey", "mono8, mono16, rgb8 or bgr8") @ LUMA, ONE_CHANNEL)
