"""Term of a colour sensor: measured colours compared with those of the vertices."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ColorImage, Image, Window
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import Synthesis, Synthesizer, View
from abs_service.tracker.synthesis.window import NOTHING_HAS, Bordered
from abs_service.tracker.terms.base import NO_OCCLUDERS, Bounds, facing
from abs_service.tracker.terms.gradients import noiseless_color_rows
from abs_service.tracker.terms.linearization import Part, PointLinearization
from abs_service.tracker.terms.patches import Patches
from abs_service.tracker.terms.photometric.illumination import Exposed
from abs_service.tracker.terms.photometric.matching import Measured, costs_of, matched
from abs_service.tracker.terms.photometric.occlusion import occluded_pixels
from abs_service.tracker.terms.photometric.registration_bias import RegistrationBias
from abs_service.tracker.terms.photometric.texture_registration_noise import (
    NO_REGISTRATION_NOISE,
    TextureRegistrationNoise,
)
from abs_service.tracker.terms.sensor_fit import SensorFit, summarize
from abs_service.tracker.terms.vertex_counts import VertexMasks
from calib.jit import kernel, prange
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
        self._bias = RegistrationBias(self._view)
        self._bounds = bounds
        self._sigma = np.array([[noise.sigma]], np.float32)
        self._constant = bounds.inlier + 3 * (np.log(noise.sigma) + LOG_SQRT_2PI)
        self._registration_noise = registration_noise
        self._levels = np.zeros((0, 0, 3), np.uint8)
        self._bordered = Bordered(np.full(3, np.nan, np.float32), np.full(3, NOTHING_HAS, np.float32))

    def observe(
        self,
        image: Image,
        predicted: Surface,
        reach_m: float = np.inf,
        occluders: NDArray[np.float64] = NO_OCCLUDERS,
    ) -> "ObservedColor":
        """Sets the colour image; NaN, as in the border, means no measurement, and infinity an occluder."""
        if not isinstance(image, ColorImage):
            raise TypeError(f"sensor {self.sensor} has a colour noise model but delivered {type(image).__name__}")
        window = self._synthesizer.window(self.sensor, predicted, reach_m)
        picture = self._resampled(image.rgb) if self._synthesizer.resamples else self._ordered(image.rgb, window)
        texture = self._bordered.move(picture.shape[:2], window).reshape(-1, 3)
        self._bordered.inside[:] = picture[window]
        self._view.look(predicted)
        self._bias.observe(picture, predicted)
        seen = self._view.synthesize(predicted)
        widening = self._registration_noise.widening(self._view, predicted, self._sigma)
        inverse = np.float32(1) / (self._sigma * widening.factor)
        illumination = Exposed().adapt(texture[seen.pixel[0]], seen.attributes[0].T)
        if len(occluders):
            self._bordered.inside[occluded_pixels(self._view.camera, occluders)[window]] = np.inf
        return ObservedColor(
            sensor=self.sensor,
            view=self._view,
            bounds=self._bounds,
            illumination=illumination,
            bias=self._bias,
            image=picture,
            texture=texture,
            inverse=np.repeat(inverse, 3 // widening.factor.shape[1], axis=1),
            normalizer=(self._constant + 3 * widening.log.mean(axis=1)).astype(np.float32),
        )

    def _resampled(self, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
        """The image in the view's camera, NaN where unknown."""
        return self._synthesizer.image(self.sensor, rgb.astype(np.float32))

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
        image: colours (height, width, 3) in the view's camera.
        texture: the same with a border of one pixel, flattened (pixels, 3).
        inverse: inverse deviations (n or 1, 3) of the samples' colours.
        normalizer: cost (n or 1,) of a colour that agrees exactly.
    """

    sensor: str
    view: View
    bounds: Bounds
    illumination: Exposed
    bias: RegistrationBias
    image: NDArray[np.float32] | NDArray[np.uint8]
    texture: NDArray[np.float32]
    inverse: NDArray[np.float32]
    normalizer: NDArray[np.float32]

    @property
    def occluders(self) -> NDArray[np.float64]:
        """No points: colours carry no distance."""
        return NO_OCCLUDERS

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log of the density of the measured colours (population,)."""
        return self._cost_of(self._synthesize(surface), surface)

    def _synthesize(self, surface: Surface) -> Synthesis:
        """The colours of a population as this frame's exposure shows them."""
        return self.illumination.shine(self.view.synthesize(surface), surface, self.view)

    def _cost_of(self, seen: Synthesis, surface: Surface) -> NDArray[np.float64]:
        """Cost (population,) of what is synthesised."""
        out = np.empty(len(seen.pixel))
        _color_cost(seen.pixel, seen.attributes, *self._measured, out)
        return self.view.balance(out, surface, self.bounds.unseen)

    @property
    def _measured(self) -> Measured:
        return self.texture, self.inverse, self.normalizer, self.bounds.outlier, self.bounds.unseen

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> list[Part]:
        """Normalised residuals of the inliers, three channels each, and their derivatives with respect to theta."""
        residual, measured = self._residuals(self._synthesize(surface))
        use = measured & (self.normalizer + 0.5 * np.sum(residual**2, axis=1) < self.bounds.outlier)
        vertices = self.view.spread(surface, surface.vertices[0].T)
        inverse = np.broadcast_to(self.inverse, residual.shape)[use]
        rows = noiseless_color_rows(self.image, self.view.camera, vertices[use], inverse).reshape(-1, 3)
        points = np.repeat(np.flatnonzero(use), residual.shape[1])
        samples = self.view.follow(surface, sparse_jacobian)
        bias = self.bias.derivatives(vertices, rows, points)
        return [
            PointLinearization(residual[use].ravel(), rows, points, samples, vertices, bias, self.view.camera.center)
        ]

    def fit(self, surface: Surface) -> SensorFit:
        """Agreement of the sensor with a population of one."""
        seen = self._synthesize(surface)
        residual, measured = self._residuals(seen)
        pixel, known = seen.pixel[0], np.isfinite(seen.attributes[0]).all(axis=0)
        hidden = np.isinf(self.texture[pixel, 0])
        masks = VertexMasks.of(pixel, facing(self.view, surface), np.zeros_like(hidden), hidden, ~known)
        mean = -float(self._cost_of(seen, surface)[0]) / len(residual)
        size = np.sqrt(np.mean(residual**2, axis=1))
        return summarize(self.sensor, masks, measured, size, mean, channels=3)

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian, patches: Patches) -> PointLinearization:
        """See `ObservedTerm`."""
        seen, costs = self._synthesize(surface), costs_of(_color_cost, self._measured)
        return matched(self.view, surface, sparse_jacobian, seen, patches, self.image.shape, costs)

    def misfit(self, surface: Surface) -> NDArray[np.float64]:
        """Zero: colours carry no distance."""
        return np.zeros((2, 1))

    def learn(self, surface: Surface) -> None:
        """Learns nothing."""

    def _residuals(self, seen: Synthesis) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Normalised residuals (n, 3) and mask of the measured samples (n,)."""
        colors = seen.attributes[0].T.astype(np.float64)
        residual = (self.texture[seen.pixel[0]] - colors) * self.inverse
        measured = (seen.pixel[0] > 0) & np.all(np.isfinite(residual), axis=1)
        return np.where(np.reshape(measured, (-1, 1)), residual, np.inf), np.asarray(measured)


@kernel
def _color_cost(
    pixel: NDArray[np.int32],
    colors: NDArray[np.float32],
    texture: NDArray[np.float32],
    inverse: NDArray[np.float32],
    normalizer: NDArray[np.float32],
    outlier: float,
    uniform: float,
    out: NDArray[np.float64],
) -> None:
    """Sum over samples of min(normaliser + ½e², outlier), of as many samples as have noise of their own, or of all.

    Samples with an unknown colour (NaN) cost `uniform`, occluded ones (∞) the mean of an inlier.
    """
    half, most, unknown, average = np.float32(0.5), np.float32(outlier), np.float32(uniform), np.float32(1.5)
    farthest = np.float32(1e30)  # np.isfinite does not survive reordered sums
    shared = inverse.shape[0] == 1
    # No branches on what is measured, see `depth_cost._cost_of`.
    for k in prange(pixel.shape[0]):
        total, pixels, expected = 0.0, pixel[k], colors[np.intp(k) % colors.shape[0]]
        for v in range(np.uintp(pixels.size)):
            i = pixels[v]
            measured = texture[np.uintp(max(i, 0))]
            row = np.uintp(0) if shared else v
            red = (measured[0] - expected[0, v]) * inverse[row, 0]
            green = (measured[1] - expected[1, v]) * inverse[row, 1]
            blue = (measured[2] - expected[2, v]) * inverse[row, 2]
            square = red * red + green * green + blue * blue
            explained = min(normalizer[row] + half * square, most)
            cost = average + normalizer[row] if square > farthest else explained
            cost = unknown if np.isnan(square) else cost
            total += cost if i >= 0 else np.float32(0)
        out[k] = total
