"""Term of a sensor with one value per pixel: grey, Bayer mosaic, amplitude, infrared."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ChannelImage, Image, limits
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import Synthesis, Synthesizer
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.synthesis.window import NOTHING_HAS, Bordered, corner
from abs_service.tracker.terms.base import Bounds, facing
from abs_service.tracker.terms.gradients import channel_gradients, shortened
from abs_service.tracker.terms.image_noise import NORMAL_MEDIAN, noise_deviation
from abs_service.tracker.terms.linearization import Part, PointLinearization
from abs_service.tracker.terms.patches import Patches
from abs_service.tracker.terms.photometric.channel_cost import (
    CHANNEL,
    INVERSE,
    NORMALIZER,
    VALUE,
    channel_cost,
    copy,
    fill,
)
from abs_service.tracker.terms.photometric.illumination import Illumination
from abs_service.tracker.terms.photometric.matching import matched
from abs_service.tracker.terms.photometric.registration_bias import RegistrationBias
from abs_service.tracker.terms.photometric.shadow import Shadow
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_REGISTRATION_NOISE,
    NO_WIDENING,
    TextureRegistrationNoise,
)
from abs_service.tracker.terms.sensor_fit import SensorFit, summarize
from abs_service.tracker.terms.vertex_counts import VertexMasks
from calib.noise.base import LOG_SQRT_2PI, ImageNoise

#: The texel of no measurement.
UNKNOWN = np.array([np.nan, 0, 0, 0], np.float32)


class ChannelTerm:
    """−log of the density of the measured number given what the vertex has in the pixel's channel.

    Behind a Bayer mosaic only the channel that the pixel has is compared, and nothing is interpolated (section 4.1).
    """

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
        self._shadow = Shadow(self._view.camera)
        self._bias = RegistrationBias(self._view)
        self._noise = noise
        self._bounds = bounds
        self._registration_noise = registration_noise
        self._widening = NO_WIDENING
        self._image, self._is_mosaic = np.zeros((1, 1, 4), np.float32), False
        self._texels = np.zeros((0, 0, 4), np.float32)
        self._texture = np.zeros((0, 4), np.float32)
        self._bordered = Bordered(UNKNOWN, np.array([NOTHING_HAS, 0, 1, 0], np.float32))

    def observe(self, image: Image, predicted: Surface, reach_m: float = np.inf) -> None:
        """Sets the image; NaN, also in the border, means no measurement."""
        if not isinstance(image, ChannelImage):
            raise TypeError(f"sensor {self.sensor} has noise of one channel but delivered {type(image).__name__}")
        window = self._synthesizer.window(self.sensor, predicted, reach_m)
        if self._texels.shape[:2] != image.values.shape:  # new memory takes as long as filling it
            self._texels = np.full((*image.values.shape, 4), UNKNOWN, np.float32)
        self._is_mosaic = len(image.channels) > 1
        values, constant = np.ascontiguousarray(image.values[window]), LOG_SQRT_2PI + self._bounds.inlier
        fill(values, image.channels, self._noise.deviation(values), constant, *corner(window), self._texels)
        self._image = self._synthesizer.image(self.sensor, self._texels)
        texture = self._bordered.move(self._image.shape[:2], window)
        copy(self._image, *limits(window, self._image.shape), texture)
        self._texture = texture.reshape(-1, 4)
        self._view.look(predicted)
        if not self._is_mosaic:
            self._bias.observe(self._image[..., VALUE, None], predicted)
        seen = self._view.synthesize(predicted)
        self._illumination.adapt(self._by_channel(seen), seen.attributes[0].T)
        self._widening = NO_WIDENING
        inverse = self._residuals(seen, predicted)[1]
        with np.errstate(divide="ignore"):
            deviation = (1 / inverse)[:, None]
        self._widening = self._registration_noise.widening(self._view, predicted, deviation)

    def foreground(self) -> NDArray[np.float64]:
        """No points: brightness carries no distance."""
        return np.zeros((0, 3))

    def hide(self, points: NDArray[np.float64]) -> None:
        """Masks the pixels occluded by points (k, 3) [m]."""
        if len(points):
            self._bordered.inside[self._shadow.mask(points)[self._bordered.window], VALUE] = np.inf

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log of the density of the measured values (population,)."""
        seen = self._synthesize(surface)
        out = np.empty(len(seen.pixel))
        channel_cost(seen.pixel, seen.attributes, *self._measured, out)
        return self._view.balance(out, surface, self._bounds.unseen)

    def _synthesize(self, surface: Surface) -> Synthesis:
        """The values of a population as they look in this light."""
        return self._illumination.shine(self._view.synthesize(surface), surface, self._view)

    @property
    def _measured(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], float, float]:
        widening, bounds = self._widening, self._bounds
        return self._texture, widening.factor, widening.log, bounds.outlier, bounds.unseen

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of the inliers and their derivatives with respect to theta.

        The derivative of the shading is neglected: it is small compared with that of the texture.
        """
        seen = self._view.synthesize(surface)
        residual, inverse, normalizer = self._residuals(seen, surface)
        use = 0.5 * residual**2 + normalizer < self._bounds.outlier
        vertices = self._view.spread(surface, surface.vertices[0].T)
        gradients, gains = self._gradients(seen, surface)
        places, projection = project_with_jacobian(self._view.camera, vertices)
        rows = np.einsum("mi,mij->mj", gradients[use] * inverse[use, None], projection[use])
        # Noise has gradients as a print has, and the more of it there is, the better it would seem to hold a surface.
        # Its deviation is that at all samples: where the value agrees, there is less of it by chance. A fine print
        # looks like noise, but it is no residual where it agrees.
        deviation = self._noise_deviation(places) * inverse[use]
        deviation = np.minimum(deviation, np.median(np.abs(residual)) / NORMAL_MEDIAN)
        noise = deviation**2 @ np.einsum("mi,mij->m", gains[use], projection[use] ** 2)
        rows = shortened(rows, float(noise))
        samples, points = self._view.follow(surface, sparse_jacobian), np.flatnonzero(use)
        bias = self._bias.derivatives(vertices, rows, points)
        return [PointLinearization(residual[use], rows, points, samples, vertices, bias)]

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        seen = self._view.synthesize(surface)
        residual = self._residuals(seen, surface)[0]
        pixel, known = seen.pixel[0], np.isfinite(seen.attributes[0]).all(axis=0)
        hidden = np.isinf(self._texture[pixel, VALUE])
        masks = VertexMasks.of(pixel, facing(self._view, surface), np.zeros_like(hidden), hidden, ~known)
        mean = -float(self.cost(surface)[0]) / len(residual)
        return summarize(self.sensor, masks, np.isfinite(residual), np.abs(residual), mean)

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """See `Term`."""
        seen = self._synthesize(surface)

        def costs(
            pixel: NDArray[np.int32], attributes: NDArray[np.float32], samples: NDArray[np.intp]
        ) -> NDArray[np.float64]:
            texture, factor, log_factor, outlier, uniform = self._measured
            out, own = np.empty(len(pixel)), samples % len(factor)  # one may stand for all
            channel_cost(pixel, attributes, texture, factor[own], log_factor[own], outlier, uniform, out)
            return out

        return matched(self._view, surface, sparse_jacobian, seen, patches, self._image.shape, costs)

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Zero: brightness carries no distance."""
        return np.zeros((2, 1))

    def learn(self, surface: Surface) -> None:
        """Learns nothing."""

    def _by_channel(self, seen: Synthesis) -> NDArray[np.float64]:
        """Measured values at each sample (m, channels), NaN in the channels that its pixel does not show."""
        texels = self._texture[seen.pixel[0]]
        values = np.full(seen.attributes[0].T.shape, np.nan)
        values[np.arange(len(texels)), texels[:, CHANNEL].astype(int)] = texels[:, VALUE]
        return values

    def _noise_deviation(self, places: NDArray[np.float64]) -> float:
        """Standard deviation of the image's noise around places (n, 2).

        Taken for zero in a mosaic: pixels of a channel are too far apart to tell a fine print from noise.
        """
        return 0.0 if self._is_mosaic else float(noise_deviation(self._image[..., VALUE, None], places)[0])

    def _gradients(self, seen: Synthesis, surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Image gradient of each sample in its pixel's channel, to the right and down (m, 2) [1/px].

        And its variance by independent noise of the pixels of variance 1 (m, 2) [1/px²].

        A mosaic shows each channel in every other pixel, too far apart to measure the slope of a fine texture. So it is
        the surface's own where that is known, which is also exactly how a residual changes within a pixel.
        """
        channel = self._texture[seen.pixel[0], CHANNEL].astype(int)
        own = replace(seen, attributes=self._view.attribute_gradients(surface).T)  # along both axes, as two members
        shining = self._illumination.shine(own, surface, self._view).attributes
        gradients = shining[:, channel, np.arange(len(channel))].T.astype(np.float64)
        unknown = np.isnan(gradients).any(axis=1)
        samples = self._view.spread(surface, surface.vertices[0].T.astype(np.float64))[unknown]
        gains = self._view.gradient_noise_gains(surface)
        gradients[unknown], gains[unknown] = channel_gradients(
            self._image[..., VALUE], self._image[..., CHANNEL], self._view.camera, samples
        )
        return gradients, gains

    def _residuals(
        self, seen: Synthesis, surface: Surface
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Normalised residual, infinite without a measurement, inverse deviation, log of the normaliser, each (n,)."""
        shining = self._illumination.shine(seen, surface, self._view)
        texels = self._texture[seen.pixel[0]].astype(np.float64)
        each, channel = np.arange(len(texels)), texels[:, CHANNEL].astype(int)
        widening = self._widening
        # One widening may stand for all samples, or for all channels.
        of = each % len(widening.factor), channel % widening.factor.shape[1]
        inverse = texels[:, INVERSE] / widening.factor[of]
        residual = (texels[:, VALUE] - shining.attributes[0][channel, each]) * inverse
        measured = (seen.pixel[0] > 0) & np.isfinite(residual)
        return np.where(measured, residual, np.inf), inverse, texels[:, NORMALIZER] + widening.log[of]
