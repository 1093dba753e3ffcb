"""Seeds: prior knowledge of the object, as pixels of a depth image and the surface that they lie on."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView, Step
from abs_service.tracker.detection.initial_detection import DetectionError, UndecidedError
from abs_service.tracker.detection.segments.depth_segments import large_surfaces, surface_at

#: Radius of the disc around a seed's pixel that belongs to the object, as a share of the image's width.
DISC = 1 / 64

#: Colours are alike up to this difference in CIE L*a*b*, in which L*, that changes in the shade, counts half.
MAX_COLOR_DIFFERENCE, LIGHTNESS_COUNTS = 14.0, 0.5

#: Number of images over the time in which motion is looked for, and in how many of them something farther away has to
#: be where a moved surface is now: single distances beside a moving edge are wrong.
COMPARED, BEHIND = 8, 3

#: Width of the square that has to have moved for its centre to count: pixels at a rim show what is behind as well.
RIM_PX = 5

#: Pixels of alike colours are connected over gaps of fewer pixels than this, as a print has them.
PRINT_PX = 5

#: Least approach of what moved, in standard deviations of the distances: far walls change by noise alone.
MOVING = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Seeded:
    """Result of a seed in one image.

    Attributes:
        core: pixels (height, width) that are the object's.
        surface: pixels (height, width) of the connected surface on which they lie.
    """

    core: NDArray[np.bool_]
    surface: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class SurfaceLimits:
    """Largest step within a surface, and smallest size of one: see `large_surfaces`."""

    maximum_step_m: Step
    minimum_pixels: int


#: Finds a seed in a view; DetectionError if it is not there.
Seed = Callable[[DepthView, SurfaceLimits], Seeded]


@dataclass(frozen=True, slots=True)
class PixelSeed:
    """The surface at a pixel.

    Attributes:
        pixel: its column and row.
    """

    pixel: tuple[int, int]

    def __call__(self, view: DepthView, limits: SurfaceLimits) -> Seeded:
        """The disc of the surface that is nearest to the pixel; DetectionError if there is no surface near it."""
        surface = surface_at(self.pixel, view.distance, view.step(limits.maximum_step_m), limits.minimum_pixels)
        row, column = np.ogrid[: surface.shape[0], : surface.shape[1]]
        away = np.hypot(column - self.pixel[0], row - self.pixel[1])
        return Seeded(surface & (away <= away[surface].min() + DISC * surface.shape[1]), surface)


@dataclass(frozen=True, slots=True)
class ColorSeed:
    """The largest patch of a colour.

    Attributes:
        color: red, green, blue in 0…255.
    """

    color: tuple[int, int, int]

    def __call__(self, view: DepthView, limits: SurfaceLimits) -> Seeded:
        """The patch; DetectionError if nothing of the colour is in sight."""
        rgb = view.colors.rgb
        if not np.isfinite(rgb).any():
            raise DetectionError(
                'color needs a colour camera (noise type "color") that sees what the depth sensor does'
            )
        what = f"no surface of about the color {list(self.color)}"
        return _largest_patch(view, limits, joined(alike(rgb, np.array([self.color], np.float32))), what)


class MotionSeed:
    """The surface that moved in front of the previous scene; compares the last of images in order of time.

    Args:
        seconds: for how long images are compared [s].
        minimum_m: how much nearer than before a moved surface is [m].
    """

    def __init__(self, seconds: float, minimum_m: float):
        self._seconds, self._minimum_m = seconds, minimum_m
        self._before: deque[tuple[int, NDArray[np.float32]]] = deque()

    def __call__(self, view: DepthView, limits: SurfaceLimits) -> Seeded:
        """The largest patch that moved; DetectionError if none did, UndecidedError while too few images are known."""
        compared_s = self._remember(view)
        if compared_s < self._seconds:
            raise UndecidedError(
                f"what moves is looked for in the images of {self._seconds:g} s, of which {compared_s:.2f} s are there"
            )
        before = np.sort([np.nan_to_num(distance, nan=-np.inf) for _, distance in self._before], axis=0)
        with np.errstate(invalid="ignore"):
            minimum = np.fmax(self._minimum_m, MOVING * view.deviation)
            nearer = before[-min(BEHIND, len(before))] - view.distance > minimum
        inner = np.asarray(cv2.erode(nearer.view(np.uint8), np.ones((RIM_PX, RIM_PX)))).view(np.bool_)
        by = f"{self._minimum_m:g} m towards the camera, or in front of something, in {self._seconds:g} s"
        what = f"nothing moved by {by}"
        return _largest_patch(view, limits, inner, what)

    def _remember(self, view: DepthView) -> float:
        """Adds an image to those that are compared; returns the time that they cover [s]."""
        period_ns = self._seconds * 1e9
        if self._before and view.distance.shape != self._before[-1][1].shape:
            self._before.clear()
        while len(self._before) > 1 and view.t_ns - self._before[1][0] >= period_ns:
            self._before.popleft()
        if self._before and not 0 <= view.t_ns - self._before[-1][0] <= period_ns:
            self._before.clear()  # no detection for a while
        if not self._before or view.t_ns - self._before[-1][0] >= period_ns / COMPARED:
            self._before.append((view.t_ns, view.distance))
        return (view.t_ns - self._before[0][0]) * 1e-9


def alike(rgb: NDArray[np.float32], colors: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels (height, width) of about one of some colours.

    Args:
        rgb: red, green, blue (height, width, 3) in 0…255, NaN where unknown.
        colors: the same of the colours (k, 3).
    """
    image = _lab(rgb)
    with np.errstate(invalid="ignore"):
        differences = [np.linalg.norm(image - color, axis=-1) for color in _lab(colors[None])[0]]
        return np.asarray(np.min(differences, axis=0) <= MAX_COLOR_DIFFERENCE)


def joined(pixels: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Pixels (height, width) without those that stand alone, and with small gaps between the others closed."""
    there = cv2.morphologyEx(pixels.view(np.uint8), cv2.MORPH_OPEN, np.ones((2, 2)))
    return np.asarray(cv2.morphologyEx(there, cv2.MORPH_CLOSE, np.ones((PRINT_PX, PRINT_PX)))).view(np.bool_)


def _largest_patch(view: DepthView, limits: SurfaceLimits, pixels: NDArray[np.bool_], what: str) -> Seeded:
    """The largest connected patch of pixels (height, width) on a connected surface; `what` is missing otherwise.

    Raises:
        DetectionError: none has `minimum_pixels`.
    """
    labels, large = large_surfaces(view.distance, view.step(limits.maximum_step_m), limits.minimum_pixels)
    there = (pixels & np.isin(labels, large)).view(np.uint8)
    patches = np.asarray(cv2.connectedComponents(cv2.morphologyEx(there, cv2.MORPH_OPEN, np.ones((3, 3))))[1])
    sizes = np.bincount(patches.ravel())[1:]
    maximum = int(sizes.max(initial=0))
    if maximum < limits.minimum_pixels:
        raise DetectionError(f"{what}: the largest has {maximum} pixels, minimum_pixels = {limits.minimum_pixels}")
    patch = patches == 1 + np.argmax(sizes)
    surface = labels == np.argmax(np.bincount(labels[patch]))
    return Seeded(patch & surface, surface)


def _lab(rgb: NDArray[np.float32]) -> NDArray[np.float32]:
    """L*, counted less, a* and b* (height, width, 3) of sRGB colours in 0…255."""
    lab = cv2.cvtColor(rgb / np.float32(255), cv2.COLOR_RGB2LAB)
    return np.asarray(lab * (LIGHTNESS_COUNTS, 1, 1), np.float32)
