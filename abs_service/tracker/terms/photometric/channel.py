"""Term of a sensor with one value per pixel: grey, Bayer mosaic, amplitude, infrared."""

from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ChannelImage, Image, limits
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.synthesis.window import NOTHING_HAS, Bordered, corner
from abs_service.tracker.terms.base import Bounds, Prediction
from abs_service.tracker.terms.photometric.channel_cost import VALUE, copy, fill
from abs_service.tracker.terms.photometric.illumination import Illumination
from abs_service.tracker.terms.photometric.observed_channel import ObservedChannel
from abs_service.tracker.terms.photometric.occlusion import occluded_pixels
from abs_service.tracker.terms.photometric.registration_bias import RegistrationBias
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_REGISTRATION_NOISE,
    NO_WIDENING,
    TextureRegistrationNoise,
)
from abs_service.tracker.terms.places.keypoints import Keypoints
from abs_service.tracker.terms.places.sift import Grey
from calib.noise.base import LOG_SQRT_2PI, ImageNoise

#: The texel of no measurement.
UNKNOWN = np.array([np.nan, 0, 0, 0], np.float32)


class ChannelTerm:
    """−log of the density of the measured number given what the vertex has in the pixel's channel, frame by frame.

    Behind a Bayer mosaic only the channel that the pixel has is compared, and nothing is interpolated (section 4.1).
    """

    finds_occluders = False

    def __init__(
        self,
        sensor: str,
        synthesizer: Synthesizer,
        appearance: NDArray[np.float32],
        noise: ImageNoise,
        illumination: Illumination,
        bounds: Bounds,
        registration_noise: TextureRegistrationNoise = NO_REGISTRATION_NOISE,
    ):
        self.sensor = sensor
        self._synthesizer = synthesizer
        self._view = synthesizer.view(sensor, appearance)
        self._illumination = illumination
        self._bias = RegistrationBias(self._view.camera)
        self._keypoints = Keypoints(self._view.camera)
        self._noise = noise
        self._bounds = bounds
        self._registration_noise = registration_noise
        self._texels = np.zeros((0, 0, 4), np.float32)
        self._bordered = Bordered(UNKNOWN, np.array([NOTHING_HAS, 0, 1, 0], np.float32))

    def observe(self, image: Image, prediction: Prediction) -> ObservedChannel:
        """Sets the image; NaN, also in the border, means no measurement, and infinity an occluder."""
        if not isinstance(image, ChannelImage):
            raise TypeError(f"sensor {self.sensor} has noise of one channel but delivered {type(image).__name__}")
        predicted, occluders = prediction.surface, prediction.occluders
        window = self._synthesizer.window(self.sensor, predicted, prediction.reach_m)
        if self._texels.shape[:2] != image.values.shape:  # new memory takes as long as filling it
            self._texels = np.full((*image.values.shape, 4), UNKNOWN, np.float32)
        is_mosaic = len(image.channels) > 1
        values, constant = np.ascontiguousarray(image.values[window]), LOG_SQRT_2PI + self._bounds.inlier
        fill(values, image.channels, self._noise.deviation(values), constant, *corner(window), self._texels)
        picture = prediction.resampling.image(self.sensor, self._texels)
        texture = self._bordered.move(picture.shape[:2], window)
        copy(picture, *limits(window, picture.shape), texture)
        view = self._view.observe(predicted)
        seen = view.synthesize(predicted)
        if not is_mosaic:
            self._bias.observe(picture[..., VALUE, None], seen, predicted)
        shown = picture[..., VALUE] if self._synthesizer.resamples else image.values  # as a whole
        observed = ObservedChannel(
            sensor=self.sensor,
            view=view,
            bounds=self._bounds,
            illumination=self._illumination,
            widening=NO_WIDENING,
            bias=self._bias,
            keypoints=self._keypoints.observe(partial(_means if is_mosaic else np.asarray, shown), predicted),
            image=picture,
            texture=texture.reshape(-1, 4),
            is_mosaic=is_mosaic,
        ).exposed(predicted)
        widening = self._registration_noise.widening(view.attribute_gradients(seen), observed.deviation(predicted))
        if len(occluders):
            self._bordered.inside[occluded_pixels(self._view.camera, occluders)[window], VALUE] = np.inf
        return replace(observed, widening=widening)


def _means(mosaic: NDArray[np.float32]) -> Grey:
    """Means (height, width) of all channels of a mosaic."""
    return np.asarray(cv2.blur(mosaic, (2, 2)), np.float32)
