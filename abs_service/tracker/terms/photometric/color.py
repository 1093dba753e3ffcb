"""Term of a colour sensor: measured colours compared with those of the vertices."""

from dataclasses import dataclass, field
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ColorImage, Image, Window
from abs_service.tracker.memo import Memo
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import ObservedView, Resampling, Synthesis, Synthesizer, once
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.base import NO_OCCLUDERS, Bounds, Prediction, facing
from abs_service.tracker.terms.gradients import noiseless_color_rows
from abs_service.tracker.terms.linearization import Part, PointLinearization, not_longer
from abs_service.tracker.terms.photometric.color_cost import color_cost, color_residuals
from abs_service.tracker.terms.photometric.copied_pixels import CopiedPixels
from abs_service.tracker.terms.photometric.illumination import Exposed
from abs_service.tracker.terms.photometric.matching import Measured, costs_of, matched
from abs_service.tracker.terms.photometric.occlusion import occluded_pixels
from abs_service.tracker.terms.photometric.registration_bias import RegistrationBias
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_REGISTRATION_NOISE,
    TextureRegistrationNoise,
)
from abs_service.tracker.terms.places.keypoints import Keypoints, ObservedKeypoints, Recognized
from abs_service.tracker.terms.places.patches import Patches
from abs_service.tracker.terms.places.sift import Grey
from abs_service.tracker.terms.sensor_fit import SensorFit, summarize
from abs_service.tracker.terms.vertex_counts import VertexMasks
from calib.noise.base import LOG_SQRT_2PI
from calib.noise.images.color import GaussianColor


class ColorTerm:
    """−log of the density of the measured colour given the vertex's own, in one frame after the other."""

    finds_occluders = False

    def __init__(
        self,
        sensor: str,
        synthesizer: Synthesizer,
        colors: NDArray[np.float32],
        noise: GaussianColor,
        bounds: Bounds,
        registration_noise: TextureRegistrationNoise = NO_REGISTRATION_NOISE,
    ):
        self.sensor = sensor
        self._synthesizer = synthesizer
        self._view = synthesizer.view(sensor, colors)
        self._bias = RegistrationBias(self._view.camera)
        self._keypoints = Keypoints(self._view.camera)
        self._bounds = bounds
        self._sigma = np.array([[noise.sigma]], np.float32)
        self._constant = bounds.inlier + 3 * (np.log(noise.sigma) + LOG_SQRT_2PI)
        self._registration_noise = registration_noise
        self._levels = np.zeros((0, 0, 3), np.uint8)
        self._pixels = CopiedPixels()

    def observe(self, image: Image, prediction: Prediction) -> "ObservedColor":
        """Sets the colour image; NaN, as in the border, means no measurement, and infinity an occluder."""
        if not isinstance(image, ColorImage):
            raise TypeError(f"sensor {self.sensor} has a colour noise model but delivered {type(image).__name__}")
        predicted, occluders = prediction.surface, prediction.occluders
        window = self._synthesizer.window(self.sensor, predicted, prediction.reach_m)
        picture = self._picture(image.rgb, window, prediction.resampling)
        self._pixels.observe(picture, window)
        view = self._view.observe(predicted)
        seen = view.synthesize(predicted)
        self._bias.observe(picture, seen, predicted)
        widening = self._registration_noise.widening(view.attribute_gradients(seen), self._sigma)
        inverse = np.float32(1) / (self._sigma * widening.factor)
        illumination = Exposed().adapt(self._pixels.at(seen.pixel)[seen.pixel[0]], seen.attributes[0].T)
        if len(occluders):
            self._pixels.cover(occluded_pixels(self._view.camera, occluders))
        shown = picture if self._synthesizer.resamples else image.rgb  # as a whole
        return ObservedColor(
            sensor=self.sensor,
            view=view,
            bounds=self._bounds,
            illumination=illumination,
            bias=self._bias,
            image=picture,
            pixels=self._pixels,
            keypoints=self._keypoints.observe(partial(_grey, shown), predicted),
            inverse=np.repeat(inverse, 3 // widening.factor.shape[1], axis=1),
            normalizer=(self._constant + 3 * widening.log.mean(axis=1)).astype(np.float32),
        )

    def _picture(
        self, rgb: NDArray[np.uint8], window: Window, resampling: Resampling
    ) -> NDArray[np.float32] | NDArray[np.uint8]:
        """The image in the view's camera, complete in the window; NaN where a resampled one is unknown."""
        if self._synthesizer.resamples:
            return resampling.image(self.sensor, rgb.astype(np.float32))
        return self._ordered(rgb, window)

    def _ordered(self, rgb: NDArray[np.uint8], window: Window) -> NDArray[np.uint8]:
        """The image, of which a view with reversed channels is copied in the window: one layout for the kernels."""
        if rgb.flags.c_contiguous:
            return rgb
        if self._levels.shape != rgb.shape:
            self._levels = np.zeros(rgb.shape, np.uint8)
        self._levels[window] = rgb[window]
        levels = self._levels.view()
        levels.setflags(write=False)  # as frames are
        return levels


@dataclass(frozen=True, slots=True, eq=False)
class ObservedColor:
    """−log of the density of the colours of one image, see `ObservedTerm`.

    Attributes:
        sensor: name of the sensor.
        view: of the mesh in its camera.
        bounds: costs of the outlier model.
        illumination: exposure of the image.
        bias: of the registration of edges.
        keypoints: of the appearance.
        image: colours (height, width, 3) in the view's camera.
        pixels: the same with a border of one pixel, as samples read them.
        inverse: inverse deviations (n or 1, 3) of the samples' colours.
        normalizer: cost (n or 1,) of a colour that agrees exactly.
        illuminated: syntheses of populations of one, see `once`.
    """

    sensor: str
    view: ObservedView
    bounds: Bounds
    illumination: Exposed
    bias: RegistrationBias
    keypoints: ObservedKeypoints
    image: NDArray[np.float32] | NDArray[np.uint8]
    pixels: CopiedPixels
    inverse: NDArray[np.float32]
    normalizer: NDArray[np.float32]
    illuminated: Memo[Surface, Synthesis] = field(init=False, default_factory=Memo[Surface, Synthesis])

    @property
    def occluders(self) -> NDArray[np.float64]:
        """No points: colours carry no distance."""
        return NO_OCCLUDERS

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log of the density of the measured colours (population,)."""
        return self._cost_of(self._synthesize(surface))

    def _synthesize(self, surface: Surface) -> Synthesis:
        """The colours of a population as this frame's exposure shows them."""
        return once(self.illuminated, surface, lambda one: self.illumination.illuminate(self.view.synthesize(one), one))

    def _cost_of(self, seen: Synthesis) -> NDArray[np.float64]:
        """Cost (population,) of what is synthesised."""
        out = np.empty(len(seen.pixel))
        color_cost(seen.pixel, seen.attributes, *self._measured(seen.pixel), out)
        return seen.interpolation.balance(out, self.bounds.unseen)

    def _measured(self, pixel: NDArray[np.int32]) -> Measured:
        return self.pixels.at(pixel), self.inverse, self.normalizer, self.bounds.outlier, self.bounds.unseen

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of the inliers, three channels each, and their derivatives with respect to theta."""
        seen = self._synthesize(surface)
        residual, square = self._residuals(seen)
        use = (self.normalizer + 0.5 * square < self.bounds.outlier).nonzero()[0]
        vertices = seen.interpolation.spread(surface.vertices[0].T)
        inverse = self.inverse[use] if len(self.inverse) > 1 else self.inverse
        rows = noiseless_color_rows(self.image, self.view.camera, vertices[use], inverse).reshape(-1, 3)
        points = np.repeat(use, residual.shape[1])
        samples = seen.interpolation.follow(sparse_jacobian)
        bias = partial(self.bias.derivatives, vertices, rows, points)
        own = partial(self._of_appearance, seen, use, vertices[use], inverse)
        center = self.view.camera.center
        return [PointLinearization(residual[use].ravel(), rows, points, samples, vertices, bias, center, own)]

    def _of_appearance(
        self,
        seen: Synthesis,
        use: NDArray[np.intp],
        vertices: NDArray[np.floating],
        inverse: NDArray[np.float32],
        rows: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Derivatives (3 m, 3) of residuals by gradients of the appearance; those by the image's where unknown.

        Args:
            seen: the synthesis of a population of one.
            use: indices of its samples (m,).
            vertices: their positions (m, 3) [m].
            inverse: inverse deviations (m or 1, 3).
            rows: derivatives (3 m, 3) by gradients of the image.
        """
        gradients = self.view.attribute_gradients(seen)[use] * inverse[..., None]
        own = (gradients @ project_with_jacobian(self.view.camera, vertices)[1]).reshape(rows.shape)
        return not_longer(lambda: np.where(np.isnan(own), rows, own), rows)

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        seen = self._synthesize(surface)
        square = self._residuals(seen)[1]
        pixel, known = seen.pixel[0], np.isfinite(seen.attributes[0]).all(axis=0)
        hidden = np.isinf(self.pixels.at(seen.pixel)[pixel, 0])
        front = facing(seen, surface, self.view.camera.center)
        masks = VertexMasks(pixel, front, np.zeros_like(hidden), hidden, ~known)
        mean = -float(self._cost_of(seen)[0]) / len(square)
        return summarize(self.sensor, masks, square < np.inf, np.sqrt(square / 3), mean, channels=3)

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """See `ObservedTerm`."""
        seen, costs = self._synthesize(surface), costs_of(color_cost, self._measured)
        return matched(self.view.camera, surface, sparse_jacobian, seen, patches, self.image.shape, costs)

    @property
    def recognized(self) -> Recognized:
        """See `ObservedTerm`."""
        return self.keypoints.recognized

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Zero: colours carry no distance."""
        return np.zeros((2, 1))

    def learn(self, surface: Surface) -> None:
        """Learns the keypoints of the first image."""
        self.keypoints.learn(surface)

    def _residuals(self, seen: Synthesis) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Normalised residuals (n, 3), and the sums of their squares (n,); infinite where nothing is measured."""
        n = seen.pixel.shape[1]
        residual, square = np.empty((n, 3)), np.empty(n)
        color_residuals(seen.pixel[0], seen.attributes[0], self.pixels.at(seen.pixel), self.inverse, residual, square)
        return residual, square


def _grey(picture: NDArray[np.float32] | NDArray[np.uint8]) -> Grey:
    """Luma (height, width) of red, green, blue (height, width, 3)."""
    grey = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY)
    return np.asarray(grey, np.uint8) if picture.dtype == np.uint8 else np.asarray(grey, np.float32)
