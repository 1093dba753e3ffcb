"""Bias of a registration: the edges of a print are matched beside their place, all by the same fraction of a pixel.

The appearance is interpolated linearly in the first image, and synthesised at the centres of pixels to first order.
Both err by the second derivative f'' of the picture times a factor that depends on where a vertex lies between pixels.
With the image gradient g, an error e in the values moves the whole print by Σ g e / Σ g². On a smooth print that
averages out. Along a sharp edge that is parallel to the pixels' columns or rows, the factor is the same for all
vertices of a column or row, and the errors add up (systematic errors of digital image correlation: H. W. Schreier,
J. R. Braasch, M. A. Sutton, Optical Engineering 39, 2000). No residual shows it, since the estimate follows it.
"""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesis
from abs_service.tracker.terms.image_noise import noise_deviation
from calib.camera import Camera

#: Deviation of the factor on f'': of ½ p (1 − p) at a place p between two pixels, and of ½ δ² at a distance δ from a
#: pixel's centre, both uniform.
FACTOR = np.sqrt(1 / 120 + 1 / 320)

#: Largest bias: half a pixel, beyond which another pixel would match better [px].
MAX_PX = 0.5


class RegistrationBias:
    """The bias of one print in the images of one sensor, as large as the first of them shows.

    Args:
        camera: of the images.
    """

    def __init__(self, camera: Camera):
        self._camera = camera
        self._deviation_px, self._begun = 0.0, False

    def observe(self, image: NDArray[np.float32] | NDArray[np.uint8], seen: Synthesis, predicted: Surface) -> None:
        """Measures the bias in the first image (height, width, channels), where the predicted mesh is seen in it."""
        if not self._begun:
            vertices = seen.interpolation.spread(predicted.vertices[0].T)
            self._deviation_px = deviation_px(image, self._camera.project(vertices))
            self._begun = True

    def derivatives(
        self, vertices: NDArray[np.floating], rows: NDArray[np.float64], points: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        """Derivatives (m, 2) of residuals with respect to a shift to the right and down, times its deviation.

        Args:
            vertices: positions (n, 3) [m].
            rows: derivatives of the residuals with respect to the position of their vertex (m, 3) [1/m].
            points: index of the vertex of each residual (m,).
        """
        camera = self._camera
        axes = camera.T_rs[:3]
        depth = (vertices - camera.center) @ axes[:, 2]
        return (
            rows
            @ (axes[:, :2] * (self._deviation_px / camera.fx, self._deviation_px / camera.fy))
            * depth[points, None]
        )


def deviation_px(image: NDArray[np.float32] | NDArray[np.uint8], places: NDArray[np.float64]) -> float:
    """Standard deviation of the bias, root mean square of both directions [px]; 0 without a print.

    Args:
        image: measured values (height, width, channels); NaN where unknown.
        places: of the vertices in it (n, 2) [px].
    """
    last = np.array(image.shape[1::-1]) - 1
    pixel = np.floor(places[np.isfinite(places).all(axis=1)] + 0.5).astype(np.intp)
    column, row = pixel[np.all((pixel > 0) & (pixel < last), axis=1)].T
    deviation, steps = noise_deviation(image, places), np.array([[-1], [0], [1]])
    right = _square(image[row, column + steps].astype(np.float64), column, deviation)
    down = _square(image[row + steps, column].astype(np.float64), row, deviation)
    return float(min(FACTOR * np.sqrt((right + down) / 2), MAX_PX))


def _square(values: NDArray[np.float64], line: NDArray[np.intp], deviation: NDArray[np.float64]) -> float:
    """Σ_lines (Σ g f'')² / (Σ g²)² along one axis, without the share of noise [px²].

    Args:
        values: of three pixels in a row along the axis, around each vertex (3, n, channels).
        line: column or row of the vertex (n,), all of which have the same place between pixels.
        deviation: of the noise (channels,).
    """
    known = np.isfinite(values).all(axis=(0, 2))
    (before, here, after), line, noise = values[:, known], line[known], np.square(deviation)
    gradient, second = (after - before) / 2, after - 2 * here + before
    slope = float(np.sum(np.square(gradient) - noise / 2))
    if slope <= 0:
        return 0.0
    moved = np.bincount(line, np.sum(gradient * second, axis=1))
    by_noise = np.sum(6 * noise * np.square(gradient) + noise / 2 * np.square(second) - 3 * np.square(noise))
    return max(float(moved @ moved) - float(by_noise), 0.0) / slope**2
