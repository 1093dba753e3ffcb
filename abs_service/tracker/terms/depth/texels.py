"""The noise texture of a depth image: what the cost kernels read, rendered once for a frame.

A texel is what `calib.noise.texture.write_texture` writes, or a constant cost where there is no usable distance.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Window
from abs_service.tracker.synthesis.base import Resampling, Synthesizer
from abs_service.tracker.synthesis.window import Bordered, corner, within
from abs_service.tracker.terms.base import Bounds
from abs_service.tracker.terms.depth.depth_cost import (
    ConstantCosts,
    distances,
    median_inlier_cost,
    settle,
    write_constants,
)
from abs_service.tracker.terms.median import median
from calib.jit import kernel
from calib.noise.base import DepthNoise
from calib.noise.scaled import Scaled
from calib.noise.texture import corrected_distances, normalizers, write_pixels, write_texture

#: Approximate number of pixels on the object whose median is the cost of an inlier.
SAMPLED = 500


@dataclass(frozen=True, slots=True, eq=False)
class Unusable:
    """Pixels of a window (rows, columns) without a usable distance.

    Attributes:
        masked: behind an occluder, in a hole, or left to the outline.
        free_m: distance from the object where the sensor looks past it [m], else 0.
        shown: those on the object, whose distances are usable.
    """

    masked: NDArray[np.bool_]
    free_m: NDArray[np.float32]
    shown: NDArray[np.bool_]


class Texels(Protocol):
    """The texture of one sensor's frame in its view."""

    def observe(self, image: DepthImage, window: Window, scale: float, resampling: Resampling) -> NDArray[np.float32]:
        """Begins a frame; distances (rows, columns) in the window of the view [m], without mean offset, NaN if unknown.

        Args:
            image: the depth image.
            window: of the view.
            scale: on the deviations of the noise model.
            resampling: of the image for the view.
        """
        ...

    def explain(self, unusable: Unusable) -> float:
        """Sets constant costs where there is no usable distance; the median cost of an inlier on the object [nats].

        A pixel at a distance d > 0 from the object, in free space, costs an outlier and what `FREE_SCALE_M` says; a
        masked one costs an inlier, and a missing return an inlier plus what it costs the sample that meets it.
        """
        ...

    def at(self, pixel: NDArray[np.int32]) -> NDArray[np.float32]:
        """The texture (pixels, 8), complete at the pixels of samples (population, m), see `Synthesis`."""
        ...

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the view."""
        ...


def missing_texel(agreeing: float) -> NDArray[np.float32]:
    """Texel (8,) of a missing return: cost of an inlier, and what it costs the sample that meets it (`depth_cost`)."""
    return np.array([0, 0, 0, 0, 0, 0, agreeing, 1], np.float32)


def texels(sensor: str, synthesizer: Synthesizer, noise: DepthNoise, bounds: Bounds) -> Texels:
    """The texture of a sensor: whole if the synthesis resamples images, else only where it is read."""
    border = np.array([0, 0, 0, 0, 0, 0, bounds.uniform, 0], np.float32)
    # Cost of no measurement, unbounded, so that leaving the image does not lower the cost.
    beyond = np.array([0, 0, 0, 0, 0, 0, bounds.outlier - bounds.inlier, 0], np.float32)
    image = Bordered(border, beyond)
    return WholeTexels(sensor, noise, image) if synthesizer.resamples else TexelsOnDemand(noise, image)


class WholeTexels:
    """A texture that is rendered in the sensor's image and resampled for the view; see `Texels`."""

    def __init__(self, sensor: str, noise: DepthNoise, image: Bordered):
        self._sensor, self._noise, self._image = sensor, noise, image
        self._texture = np.zeros((2, 2, 8), np.float32)
        self._window: Window = image.window
        self._distance = np.zeros((0, 0), np.float32)

    def observe(self, image: DepthImage, window: Window, scale: float, resampling: Resampling) -> NDArray[np.float32]:
        """Renders the noise model over the window."""
        texture = self._image.begin(image.shape, window)
        write_texture(Scaled(self._noise, scale), *image.within(window), corner(window), texture)
        self._texture, self._window = resampling.texture(self._sensor, texture), window
        part = within(self._texture, window)
        self._distance = np.empty(part.shape[:2], np.float32)
        distances(part, self._distance)
        return self._distance

    def explain(self, unusable: Unusable) -> float:
        """Writes the constants into the window."""
        agreeing = median_inlier_cost(within(self._texture, self._window), unusable.shown)
        missing, outlier = missing_texel(agreeing), float(self._image.beyond[6])
        costs = ConstantCosts(unusable.masked, self._distance, unusable.free_m, missing, agreeing, outlier)
        write_constants(costs, corner(self._window), self._texture)
        return agreeing

    def at(self, pixel: NDArray[np.int32]) -> NDArray[np.float32]:
        """The whole texture."""
        return self._texture.reshape(-1, 8)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the view."""
        return self._texture.shape[0] - 2, self._texture.shape[1] - 2


class TexelsOnDemand:
    """A texture that is rendered where single candidates read it, and over the window for populations; see `Texels`.

    A descent reads a few pixels around every vertex: a tenth of those on the object.
    """

    def __init__(self, noise: DepthNoise, image: Bordered):
        self._noise, self._scaled, self._image = noise, Scaled(noise, 1), image
        self._texture = np.zeros((2, 2, 8), np.float32)
        self._window: Window = image.window
        self._distance = self._amplitude = np.zeros((0, 0), np.float32)
        self._done = np.zeros((0, 0), np.bool_)
        self._costs = ConstantCosts(self._done, self._distance, self._distance, image.border, 0.0, 0.0)
        self._complete: list[NDArray[np.int32]] = []  # pixels of single candidates, which are read again and again
        self._is_whole = False

    def observe(self, image: DepthImage, window: Window, scale: float, resampling: Resampling) -> NDArray[np.float32]:
        """Corrects the distances in the window, and renders nothing yet."""
        self._texture, self._window = self._image.move(image.shape, window), window
        self._scaled = Scaled(self._noise, scale)
        self._distance, self._amplitude = (np.ascontiguousarray(part, np.float32) for part in image.within(window))
        corrected = corrected_distances(self._noise, self._distance, self._amplitude, corner(window))
        self._done, self._complete, self._is_whole = np.zeros(corrected.shape, np.bool_), [], False
        none, outlier = np.zeros(corrected.shape, np.bool_), float(self._image.beyond[6])
        nowhere = np.zeros(corrected.shape, np.float32)
        self._costs = ConstantCosts(none, corrected, nowhere, self._image.border, 0.0, outlier)
        return corrected

    def explain(self, unusable: Unusable) -> float:
        """Remembers what is unusable, and finds the cost of some pixels on the object."""
        shown, (top, left) = np.flatnonzero(unusable.shown), corner(self._window)
        some = shown[:: max(len(shown) // SAMPLED, 1)]
        row, column = np.divmod(some, unusable.shown.shape[1])
        measured, amplitude = (part.ravel()[some].astype(np.float64) for part in (self._distance, self._amplitude))
        costs = normalizers(self._scaled, measured, amplitude, (row + top, column + left))
        agreeing = median(costs) + 0.5 if len(some) else 0.0
        self._costs = self._costs._replace(
            masked=unusable.masked, free_m=unusable.free_m, missing=missing_texel(agreeing), agreeing=agreeing
        )
        return agreeing

    def at(self, pixel: NDArray[np.int32]) -> NDArray[np.float32]:
        """The texture after rendering what is still missing of it."""
        if not (self._is_whole or any(pixel is one for one in self._complete)):
            self._render(pixel)
        return self._texture.reshape(-1, 8)

    def _render(self, pixel: NDArray[np.int32]) -> None:
        """Renders the pixels of a single candidate (1, m), or the window for a population (population, m)."""
        is_single = len(pixel) == 1
        pixels = pixel[0] if is_single else self._of_window()
        shape = 2, pixels.size
        wanted = RequestedTexels(self._distance, self._amplitude, np.empty(shape, np.int64), np.empty(shape))
        count = _take(pixels, corner(self._window), self._costs, self._done, self._texture, wanted)
        if count:
            (row, column), (measured, amplitude) = wanted.places[:, :count], wanted.values[:, :count]
            write_pixels(self._scaled, measured, amplitude, (row, column), self._texture)
        if is_single:
            self._complete.append(pixel)
        self._is_whole = not is_single

    def _of_window(self) -> NDArray[np.int32]:
        """Indices (m,) of all pixels of the window into the flattened texture."""
        every = np.arange(self._texture.shape[0] * self._texture.shape[1], dtype=np.int32)
        return within(every.reshape(self._texture.shape[:2]), self._window).ravel()

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the view."""
        return self._texture.shape[0] - 2, self._texture.shape[1] - 2


class RequestedTexels(NamedTuple):
    """Pixels whose texels are to be rendered.

    Attributes:
        distance, amplitude: measured ones in the window (rows, columns).
        places: rows and columns of the pixels in the image (2, …).
        values: their distances [m] and amplitudes (2, …).
    """

    distance: NDArray[np.float32]
    amplitude: NDArray[np.float32]
    places: NDArray[np.int64]
    values: NDArray[np.float64]


@kernel
def _take(
    pixels: NDArray[np.int32],
    corner: tuple[int, int],
    costs: ConstantCosts,
    done: NDArray[np.bool_],
    texture: NDArray[np.float32],
    wanted: RequestedTexels,
) -> int:
    """Writes the constant texels of pixels that are not done; the number of those with a usable distance.

    Args:
        pixels: indices (m,) into the flattened texture.
        corner: first row and column of the window.
        costs: of pixels without a usable distance.
        done: pixels (rows, columns) that are rendered; those that are taken become so.
        texture: (height + 2, width + 2, 8).
        wanted: those with a usable distance are written into it.
    """
    (top, left), count, stride = corner, 0, np.uint32(texture.shape[1])
    for m in range(pixels.size):
        pixel = np.uint32(max(pixels[m], 0))  # a division of short numbers takes a third of the time
        row, column = int(pixel // stride) - 1 - top, int(pixel % stride) - 1 - left
        inside = pixel > 0 and row >= 0 and row < done.shape[0] and column >= 0 and column < done.shape[1]
        if inside and not done[row, column]:
            done[row, column] = True
            if not settle(row, column, costs, texture[top + row + 1, left + column + 1]):
                wanted.places[0, count], wanted.places[1, count] = top + row, left + column
                wanted.values[0, count] = wanted.distance[row, column]
                wanted.values[1, count] = wanted.amplitude[row, column]
                count += 1
    return count
