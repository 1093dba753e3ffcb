"""A colour sensor's pixels against the colours of the vertices."""

import numpy as np
from numpy.typing import NDArray

from abs_service.images import ColorImage, Image
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import INLIER_DEVIATIONS, Bounds, Linearization, SensorFit, summarize
from abs_service.tracker.terms.gradients import chained, color_rows
from abs_service.tracker.terms.shadow import Shadow
from calib.jit import kernel
from calib.noise.base import LOG_SQRT_2PI
from calib.noise.color import GaussianColor


class ColorTerm:
    """−log of the density of the measured colour given the vertex's own, summed over the samples.

    Attributes:
        sensor: name of the sensor.
    """

    def __init__(
        self, sensor: str, synthesizer: Synthesizer, colors: NDArray[np.float32], noise: GaussianColor, bounds: Bounds
    ):
        self.sensor = sensor
        self._synthesizer = synthesizer
        self._view = synthesizer.view(sensor, colors)
        self._shadow = Shadow(self._view.camera)
        self._bounds = bounds
        self._inverse_deviation = 1 / noise.sigma
        self._normalizer = bounds.inlier + 3 * (np.log(noise.sigma) + LOG_SQRT_2PI)
        self._texture = np.zeros((0, 3), np.float32)
        self._image = np.zeros((1, 1, 3), np.float32)

    def observe(self, image: Image, predicted: Surface) -> None:
        """Takes a colour image; the border is NaN, which stands for no measurement."""
        if not isinstance(image, ColorImage):
            raise TypeError(f"sensor {self.sensor} has a colour noise model but delivered {type(image).__name__}")
        self._image = self._synthesizer.image(self.sensor, image.rgb.astype(np.float32))
        self._texture = np.pad(self._image, ((1, 1), (1, 1), (0, 0)), constant_values=np.nan).reshape(-1, 3)
        self._view.look(predicted)

    def foreground(self) -> NDArray[np.float64]:
        """None: colours do not tell what is nearer."""
        return np.zeros((0, 3))

    def hide(self, points: NDArray[np.float64]) -> None:
        """Marks the pixels that show points (k, 3) [m] before the object: their colours say nothing."""
        covered = np.pad(self._shadow.mask(points), 1).ravel()
        self._texture[covered] = np.inf

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log of the density of the measured colours (population,)."""
        seen = self._view.synthesize(surface)
        out = np.empty(len(seen.pixel))
        constants = (
            self._inverse_deviation,
            self._normalizer,
            self._bounds.outlier,
            self._bounds.inlier + self._bounds.uniform,
            self._normalizer + 1.5,
        )
        _color_cost(seen.pixel, self._texture, seen.attributes, *constants, out)
        return self._view.balance(out, surface, self._bounds.inlier + self._bounds.uniform)

    def linearize(self, surface: Surface, jacobian: NDArray[np.float64]) -> Linearization:
        """The inliers' normalised residuals, three channels each, and how they change with the parameters."""
        residual, measured = self._residuals(surface)
        use = measured & (np.sqrt(np.mean(residual**2, axis=1)) < INLIER_DEVIATIONS)
        vertices = self._view.spread(surface, surface.vertices[0].T)[use]
        rows = color_rows(self._image, self._view.camera, vertices) * self._inverse_deviation
        return Linearization(residual[use].ravel(), chained(rows, use, self._view.spread(surface, jacobian)))

    def fit(self, surface: Surface) -> SensorFit:
        """How the sensor agrees with a population of one."""
        residual, measured = self._residuals(surface)
        pixel = self._view.synthesize(surface).pixel[0]
        hidden = (pixel < 0) | np.isinf(self._texture[pixel, 0])
        mean = -float(self.cost(surface)[0]) / len(residual)
        size = np.sqrt(np.mean(residual**2, axis=1))
        return summarize(self.sensor, (pixel > 0) & ~hidden, hidden, measured, size, mean, channels=3)

    def _residuals(self, surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Normalised residuals (n, 3) and whether there is a measurement (n,)."""
        seen = self._view.synthesize(surface)
        colors = seen.attributes[0].astype(np.float64)
        residual = (self._texture[seen.pixel[0]] - colors) * self._inverse_deviation
        measured = (seen.pixel[0] > 0) & np.all(np.isfinite(residual), axis=1)
        return np.where(np.reshape(measured, (-1, 1)), residual, np.inf), np.asarray(measured)


@kernel
def _color_cost(
    pixel: NDArray[np.int32],
    texture: NDArray[np.float32],
    colors: NDArray[np.float32],
    inverse_deviation: float,
    normalizer: float,
    outlier: float,
    uniform: float,
    hidden: float,
    out: NDArray[np.float64],
) -> None:
    """Sum over samples of min(normaliser + ½e², outlier).

    Where either colour is unknown (NaN) of `uniform`, and of `hidden` where something stands before the object (∞).
    """
    scale = np.float32(0.5 * inverse_deviation * inverse_deviation)
    farthest = np.float32(3e5)  # no two colours differ by more; np.isfinite does not survive reordered sums
    for k in range(pixel.shape[0]):
        total = 0.0
        own = k % colors.shape[0]
        for v in range(pixel.shape[1]):
            if pixel[k, v] < 0:
                continue
            measured, color = texture[pixel[k, v]], colors[own, v]
            red, green, blue = measured[0] - color[0], measured[1] - color[1], measured[2] - color[2]
            square = red * red + green * green + blue * blue
            cost = hidden if square > farthest else min(normalizer + scale * square, outlier)
            total += uniform if np.isnan(square) else cost
        out[k] = total
