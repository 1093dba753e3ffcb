"""One frame of a sensor with one value per pixel: cost, residuals and agreement of deformed meshes."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import ObservedView, Synthesis
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.base import NO_OCCLUDERS, Bounds, facing
from abs_service.tracker.terms.gradients import channel_gradients, noiseless_color_rows
from abs_service.tracker.terms.linearization import Part, PointLinearization, as_measured, not_longer
from abs_service.tracker.terms.photometric.channel_cost import CHANNEL, INVERSE, NORMALIZER, VALUE, channel_cost
from abs_service.tracker.terms.photometric.illumination import Illumination
from abs_service.tracker.terms.photometric.matching import Measured, costs_of, matched
from abs_service.tracker.terms.photometric.registration_bias import RegistrationBias
from abs_service.tracker.terms.photometric.texture_registration_noise import Widening
from abs_service.tracker.terms.places.keypoints import ObservedKeypoints, Recognized
from abs_service.tracker.terms.places.patches import Patches
from abs_service.tracker.terms.sensor_fit import SensorFit, summarize
from abs_service.tracker.terms.vertex_counts import VertexMasks


@dataclass(frozen=True, slots=True, eq=False)
class ObservedChannel:
    """−log of the density of the numbers of one image, see `ObservedTerm`.

    Attributes:
        sensor: name of the sensor.
        view: of the mesh in its camera.
        bounds: costs of the outlier model.
        illumination: light of the frame.
        widening: of the noise, by that of the texture's registration.
        bias: of the registration of edges.
        keypoints: of the appearance.
        image: texels (height, width, 4) in the view's camera, see `channel_cost`.
        texture: the same with a border of one pixel, flattened (pixels, 4).
        is_mosaic: each pixel shows one of several channels.
    """

    sensor: str
    view: ObservedView
    bounds: Bounds
    illumination: Illumination
    widening: Widening
    bias: RegistrationBias
    keypoints: ObservedKeypoints
    image: NDArray[np.float32]
    texture: NDArray[np.float32]
    is_mosaic: bool

    @property
    def occluders(self) -> NDArray[np.float64]:
        """No points: brightness carries no distance."""
        return NO_OCCLUDERS

    def exposed(self, predicted: Surface) -> "ObservedChannel":
        """The frame in the light that it shows on the predicted mesh, a population of one."""
        seen = self.view.synthesize(predicted)
        return replace(self, illumination=self.illumination.adapt(self._by_channel(seen), seen.attributes[0].T))

    def deviation(self, surface: Surface) -> NDArray[np.float64]:
        """Deviation (m, 1) of the value at each sample of a population of one; infinite without a measurement."""
        inverse = self._residuals(self.view.synthesize(surface), surface)[1]
        with np.errstate(divide="ignore"):
            return (1 / inverse)[:, None]

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log of the density of the measured values (population,)."""
        seen = self._synthesize(surface)
        out = np.empty(len(seen.pixel))
        channel_cost(seen.pixel, seen.attributes, *self._measured, out)
        return seen.interpolation.balance(out, self.bounds.unseen)

    def _synthesize(self, surface: Surface) -> Synthesis:
        """The values of a population as they look in this light."""
        return self.illumination.illuminate(self.view.synthesize(surface), surface)

    @property
    def _measured(self) -> Measured:
        widening, bounds = self.widening, self.bounds
        return self.texture, widening.factor, widening.log, bounds.outlier, bounds.unseen

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of the inliers and their derivatives with respect to theta.

        The derivative of the shading is neglected: it is small compared with that of the texture.
        """
        seen = self.view.synthesize(surface)
        residual, inverse, normalizer = self._residuals(seen, surface)
        use = 0.5 * residual**2 + normalizer < self.bounds.outlier
        vertices = seen.interpolation.spread(surface.vertices[0].T)
        weight, of_appearance = inverse[use, None], partial(self._of_appearance, seen, surface, use)
        if self.is_mosaic:
            rows, own = of_appearance(weight), as_measured
        else:
            values = self.image[..., VALUE, None]
            rows = noiseless_color_rows(values, self.view.camera, vertices[use], weight)[:, 0]
            own = partial(not_longer, partial(of_appearance, weight))
        samples, points = seen.interpolation.follow(sparse_jacobian), use.nonzero()[0]
        bias, center = partial(self.bias.derivatives, vertices, rows, points), self.view.camera.center
        return [PointLinearization(residual[use], rows, points, samples, vertices, bias, center, own)]

    def _of_appearance(
        self, seen: Synthesis, surface: Surface, use: NDArray[np.bool_], weight: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Derivatives (m, 3) of residuals by gradients of the appearance, of the samples in a mask (n,).

        Args:
            seen: the synthesis of a population of one.
            surface: that population.
            use: the samples.
            weight: their inverse deviations (m, 1).
        """
        vertices = seen.interpolation.spread(surface.vertices[0].T)[use]
        projection = project_with_jacobian(self.view.camera, vertices)[1]
        return np.einsum("mi,mij->mj", self._gradients(seen, surface)[use] * weight, projection)

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        seen = self.view.synthesize(surface)
        residual = self._residuals(seen, surface)[0]
        pixel, known = seen.pixel[0], np.isfinite(seen.attributes[0]).all(axis=0)
        hidden = np.isinf(self.texture[pixel, VALUE])
        masks = VertexMasks(
            pixel, facing(seen, surface, self.view.camera.center), np.zeros_like(hidden), hidden, ~known
        )
        mean = -float(self.cost(surface)[0]) / len(residual)
        return summarize(self.sensor, masks, np.isfinite(residual), np.abs(residual), mean)

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """See `ObservedTerm`."""
        seen, costs = self._synthesize(surface), costs_of(channel_cost, lambda _: self._measured)
        return matched(self.view.camera, surface, sparse_jacobian, seen, patches, self.image.shape, costs)

    @property
    def recognized(self) -> Recognized:
        """See `ObservedTerm`."""
        return self.keypoints.recognized

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Zero: brightness carries no distance."""
        return np.zeros((2, 1))

    def learn(self, surface: Surface) -> None:
        """Learns the keypoints of the first image."""
        self.keypoints.learn(surface)

    def _by_channel(self, seen: Synthesis) -> NDArray[np.float64]:
        """Measured values at each sample (m, channels), NaN in the channels that its pixel does not show."""
        texels = self.texture[seen.pixel[0]]
        values = np.full(seen.attributes[0].T.shape, np.nan)
        values[np.arange(len(texels)), texels[:, CHANNEL].astype(int)] = texels[:, VALUE]
        return values

    def _gradients(self, seen: Synthesis, surface: Surface) -> NDArray[np.float64]:
        """Gradient of each sample of the appearance in its pixel's channel, to the right and down (m, 2) [1/px].

        That of the image where it is unknown. A mosaic shows each channel in every other pixel, too far apart to
        measure the slope of a fine texture.
        """
        channel = self.texture[seen.pixel[0], CHANNEL].astype(int)
        own = replace(seen, attributes=self.view.attribute_gradients(seen).T)  # along both axes, as two members
        illuminated = self.illumination.illuminate(own, surface).attributes
        gradients = illuminated[:, channel, np.arange(len(channel))].T.astype(np.float64)
        unknown = np.isnan(gradients).any(axis=1)
        samples = seen.interpolation.spread(surface.vertices[0].T.astype(np.float64))[unknown]
        image = self.image[..., VALUE], self.image[..., CHANNEL]
        gradients[unknown] = channel_gradients(*image, self.view.camera, samples)
        return gradients

    def _residuals(
        self, seen: Synthesis, surface: Surface
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Normalised residual, infinite without a measurement, inverse deviation, log of the normaliser, each (n,)."""
        illuminated = self.illumination.illuminate(seen, surface)
        texels = self.texture[seen.pixel[0]].astype(np.float64)
        each, channel = np.arange(len(texels)), texels[:, CHANNEL].astype(int)
        widening = self.widening
        # One widening may stand for all samples, or for all channels.
        of = each % len(widening.factor), channel % widening.factor.shape[1]
        inverse = texels[:, INVERSE] / widening.factor[of]
        residual = (texels[:, VALUE] - illuminated.attributes[0][channel, each]) * inverse
        measured = (seen.pixel[0] > 0) & np.isfinite(residual)
        return np.where(measured, residual, np.inf), inverse, texels[:, NORMALIZER] + widening.log[of]
