"""Bayer mosaics: every pixel shows the one channel that its filter passes (section 4.1)."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from abs_service.pairing.images import BAYER_ORDERS, ChannelImage, ColorImage
from abs_service.tracker.measurements.base import Comparison, Decoder, FirstImages, wrong_encoding
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.illumination import Exposed
from abs_service.tracker.terms.photometric.vertex_values import Values, at_vertices, known, mean_of_known
from calib.camera import Camera
from calib.noise.images.bayer import GaussianBayer
from calib.rig import Sensor
from drivers.contract.frame import Frame, Kind

Noise = GaussianBayer


@dataclass(frozen=True)
class Measurement:
    """Raw images behind a mosaic of filters; see `MeasurementKind`."""

    noise: GaussianBayer
    frames = (Kind.BAYER,)
    color_rank = 1

    def decoder(self, sensor: Sensor) -> Decoder:
        """Decoder of bayer_rggb8 and its other orders."""
        return _decode

    def term(self, sensor: Sensor, mesh: Mesh, synthesizer: Synthesizer, comparison: Comparison) -> ChannelTerm:
        """The channel of a vertex that the pixel's filter passes."""
        appearance, bounds = mesh.appearance_of(sensor.name), comparison.bounds
        return ChannelTerm(
            sensor.name, synthesizer, appearance, self.noise, Exposed(), bounds, comparison.registration_noise
        )

    def appearance(self, seen: Values, sensor: Sensor, first: FirstImages) -> Values:
        """Values from the colour sensors, which measure all three channels of a vertex; else the sensor's own.

        The colours are given the defocus and the crosstalk of this sensor.
        """
        filtered = []
        for name, image in first.images.items():
            if isinstance(image, ColorImage):
                camera = first.rig.sensors[name].camera
                blur_px = self.noise.defocus_px * _magnification(camera, sensor.camera, first.mesh.vertices)
                rgb = cv2.GaussianBlur(image.rgb, (0, 0), blur_px) if blur_px > 0 else image.rgb
                filtered.append(at_vertices(ColorImage(np.asarray(rgb, np.uint8)), camera, first.mesh))
        return known(self.noise.apply_crosstalk(mean_of_known(filtered, (len(first.mesh.vertices), 3))), seen)

    def colors(self, seen: Values) -> Values:
        """The demosaiced colours without crosstalk."""
        return self.noise.remove_crosstalk(seen)


def _decode(frames: Mapping[Kind, Frame]) -> ChannelImage:
    frame = frames[Kind.BAYER]
    order = frame.encoding.removeprefix("bayer_").removesuffix("8")
    if order not in BAYER_ORDERS:
        raise wrong_encoding(frame, "bayer", "bayer_rggb8, bayer_bggr8, bayer_grbg8 or bayer_gbrg8")
    return ChannelImage(frame.si(), BAYER_ORDERS[order])


def _magnification(camera: Camera, other: Camera, points: Values) -> float:
    """Pixels of one camera per pixel of another, where the points are."""
    scales = [one.fx / np.median((points - one.center) @ one.T_rs[:3, 2]) for one in (camera, other)]
    return float(scales[0] / scales[1])
