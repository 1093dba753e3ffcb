"""A depth sensor's measurements against synthesised distances."""

import numpy as np
from numpy.typing import NDArray

from abs_service.observation import ColorImage, DepthImage
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesizer
from abs_service.tracker.terms.base import INLIER_DEVIATIONS, Bounds, Linearization, SensorFit, summarize
from abs_service.tracker.terms.gradients import depth_rows
from calib.jit import kernel
from calib.noise.base import WINDOW_M, DepthNoise, render_texture


class DepthTerm:
    """−log φ of eqs. 18 and 19, summed over the samples.

    Attributes:
        sensor: name of the sensor.
    """

    def __init__(self, sensor: str, synthesizer: Synthesizer, vertices: int, noise: DepthNoise, bounds: Bounds):
        self.sensor = sensor
        self._noise = noise
        self._bounds = bounds
        self._synthesizer = synthesizer
        self._view = synthesizer.view(sensor, np.zeros((vertices, 0), np.float32))
        self._texture = np.zeros((0, 8), np.float32)

    def observe(self, image: DepthImage | ColorImage, predicted: Surface) -> None:
        """Renders the noise model over a depth image; what the predicted mesh hides is left out of this frame."""
        if not isinstance(image, DepthImage):
            raise TypeError(f"sensor {self.sensor} has a depth noise model but delivered a colour image")
        texture = render_texture(self._noise, image.distance, image.amplitude, self._bounds.uniform)
        self._texture = self._synthesizer.texture(self.sensor, texture).reshape(-1, 8)
        self._view.look(predicted)

    def cost(self, surface: Surface) -> NDArray[np.float64]:
        """−Σ_v log φ (population,); the outlier share is mixed in by the larger of the two densities."""
        seen = self._view.synthesize(surface)
        out = np.empty(len(seen.pixel))
        _depth_cost(seen.pixel, seen.distance, self._texture, self._bounds.inlier, self._bounds.outlier, out)
        return out

    def linearize(self, surface: Surface, jacobian: NDArray[np.float64]) -> Linearization:
        """The inliers' normalised residuals, and how they change with the parameters."""
        residual, inverse_deviation, measured = self._residuals(surface)
        use = measured & (np.abs(residual) < INLIER_DEVIATIONS)
        vertices, normals, change = (
            self._view.spread(surface, values)[use]
            for values in (surface.vertices[0].T, surface.normals[0].T, jacobian)
        )
        rows = depth_rows(vertices, normals, self._view.camera.center) * inverse_deviation[use, None]
        return Linearization(residual[use], np.einsum("ni,nid->nd", rows, change))

    def fit(self, surface: Surface) -> SensorFit:
        """How the sensor agrees with a population of one."""
        residual, _, measured = self._residuals(surface)
        visible = self._view.synthesize(surface).pixel[0] > 0
        mean = -float(self.cost(surface)[0]) / residual.size
        return summarize(self.sensor, visible, measured, np.abs(residual), mean)

    def _residuals(self, surface: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Normalised residual, inverse deviation, and whether there is a measurement, each (n,)."""
        seen = self._view.synthesize(surface)
        texels = self._texture[seen.pixel[0]].astype(np.float64)
        t = texels[:, 0] - seen.distance[0]
        inside = np.clip(t, -WINDOW_M, WINDOW_M)
        inverse = texels[:, 3] + inside * (texels[:, 4] + inside * texels[:, 5])
        return (t - texels[:, 1] - texels[:, 2] * inside) * inverse, inverse, (seen.pixel[0] > 0) & (texels[:, 3] > 0)


@kernel
def _depth_cost(
    pixel: NDArray[np.int32],
    distance: NDArray[np.float32],
    texture: NDArray[np.float32],
    inlier: float,
    outlier: float,
    out: NDArray[np.float64],
) -> None:
    """Sum over vertices of min(inlier + ½e² + log normaliser, outlier); texture as `render_texture` makes it."""
    window, ceiling, least = np.float32(WINDOW_M), np.float32(outlier - inlier), np.float32(inlier)
    for k in range(pixel.shape[0]):
        total = np.float32(0)
        for v in range(pixel.shape[1]):
            if pixel[k, v] < 0:
                continue
            texel = texture[pixel[k, v]]
            t = texel[0] - distance[k, v]
            inside = min(max(t, -window), window)
            e = (t - texel[1] - texel[2] * inside) * (texel[3] + inside * (texel[4] + inside * texel[5]))
            total += min(np.float32(0.5) * e * e + texel[6] + texel[7] * inside, ceiling) + least
        out[k] = total
