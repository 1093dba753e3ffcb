"""The part of a surface with an object's colours, for objects that touch others and do not differ in depth."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.segments.dominant_plane import CLEARANCE_M, above_plane
from abs_service.tracker.detection.segments.seeds import Seeded, alike, joined

#: Number of colours that the core of an object is described by: of its print, in light and shade.
COLORS = 5

#: Width of the seam in which the outline is looked for, on either side, as a share of the image's width.
SEAM = 1 / 40

#: Rounds of GrabCut, and the numbers of colours of object and background each.
ROUNDS, COMPONENTS = 5, 5


@dataclass(frozen=True, slots=True, eq=False)
class _Picture:
    """Colours of a depth image's pixels in 0…255.

    Attributes:
        rgb: (height, width, 3), NaN where unknown.
        filled: the same, rounded, with those of the nearest known pixel where unknown.
    """

    rgb: NDArray[np.float32]
    filled: NDArray[np.uint8]


def grown_by_color(seeded: Seeded, view: DepthView) -> NDArray[np.bool_]:
    """Pixels (height, width) of the object: those connected to the core that look like it, up to edges of colour.

    First all that is alike in colour, then GrabCut in a seam around its outline (C. Rother, V. Kolmogorov, A. Blake,
    SIGGRAPH 2004, as in OpenCV). From a small core alone GrabCut does not grow: outlines cost more than pixels.
    What stands on a table, or before a wall, grows once more, with all the colours that were found, but above the
    plane only: colours of many things are found somewhere on a table.

    Raises:
        DetectionError: no colour of the core is known.
    """
    rgb = view.colors.rgb
    known = np.isfinite(rgb[..., 0])
    core, surface = seeded.core & known, seeded.surface & known
    if not core.any():
        raise DetectionError('no colour camera (noise type "color") sees the seed: grow = "depth" needs none')
    picture = _Picture(rgb, _filled(rgb, known))
    object_ = _grown(core, core, surface, surface, picture)
    above = _standing(view)
    if np.count_nonzero(object_ & above) > np.count_nonzero(object_) / 2 and (core & above).any():
        standing = _part_with(surface & above, core & above) & surface & above
        object_ = _grown(core & standing, (object_ | core) & standing, standing, surface, picture)
    return object_ & seeded.surface


def _standing(view: DepthView) -> NDArray[np.bool_]:
    """Pixels (height, width) above the dominant plane; none if there is no plane."""
    try:
        return above_plane(view, CLEARANCE_M)
    except DetectionError:
        return np.zeros(view.distance.shape, np.bool_)


def _grown(
    core: NDArray[np.bool_],
    like: NDArray[np.bool_],
    first: NDArray[np.bool_],
    surface: NDArray[np.bool_],
    picture: _Picture,
) -> NDArray[np.bool_]:
    """The part (height, width) of a surface that is connected to the core and looks like some pixels.

    Args:
        core: pixels that are the object's.
        like: pixels whose colours the object has.
        first: pixels that are taken if they are alike.
        surface: pixels in which the outline is looked for.
        picture: the colours.
    """
    inner = ~_dilated(~like, 1)  # pixels at its rim may be mixed with what is beside it
    colors = _main_colors(picture.rgb[inner if inner.any() else like])
    guess = _part_with(joined(first & alike(picture.rgb, colors)) | core, core) & first
    return _part_with(_cut(guess, core, surface, picture.filled), core)


def _main_colors(rgb: NDArray[np.float32]) -> NDArray[np.float32]:
    """The most frequent colours (at most COLORS, 3) among some (k, 3)."""
    cv2.setRNGSeed(0)  # of k-means here and in GrabCut: the same image has the same region
    if len(rgb) <= COLORS:
        return rgb
    ends = (cv2.TERM_CRITERIA_COUNT, 20, 0.0)
    centers = cv2.kmeans(rgb, COLORS, np.zeros(len(rgb), np.int32), ends, 3, cv2.KMEANS_PP_CENTERS)[2]
    return np.asarray(centers, np.float32)


def _cut(
    first: NDArray[np.bool_], core: NDArray[np.bool_], surface: NDArray[np.bool_], rgb: NDArray[np.uint8]
) -> NDArray[np.bool_]:
    """The object (height, width) after GrabCut decided on the pixels in a seam around a first guess of it."""
    seam = max(2, round(SEAM * first.shape[1]))
    near, inner = _dilated(first, seam), ~_dilated(~first, seam // 2) | core
    rows, columns = (np.flatnonzero(_dilated(near, seam).any(axis=axis)) for axis in (1, 0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    labels = np.full(first.shape, cv2.GC_BGD, np.uint8)
    labels[near & surface] = cv2.GC_PR_BGD
    labels[first] = cv2.GC_PR_FGD
    labels[inner] = cv2.GC_FGD
    decided = np.ascontiguousarray(labels[window])
    background = np.count_nonzero(decided % 2 == 0)
    if min(background, decided.size - background) >= COMPONENTS:  # otherwise nearly everything around is the object
        models = np.zeros((1, 65)), np.zeros((1, 65))
        cv2.grabCut(np.ascontiguousarray(rgb[window]), decided, (0, 0, 0, 0), *models, ROUNDS, cv2.GC_INIT_WITH_MASK)
    result = np.zeros(first.shape, np.bool_)
    result[window] = decided % 2 == 1  # GC_FGD or GC_PR_FGD
    return result


def _dilated(pixels: NDArray[np.bool_], by_px: int) -> NDArray[np.bool_]:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * by_px + 1, 2 * by_px + 1))
    return np.asarray(cv2.dilate(pixels.view(np.uint8), disc)).view(np.bool_)


def _filled(rgb: NDArray[np.float32], known: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Colours (height, width, 3) with those of the nearest known pixel where they are unknown."""
    unknown = (~known).view(np.uint8)
    labels = cv2.distanceTransformWithLabels(unknown, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)[1]
    nearest = np.asarray(labels, np.intp)
    of_label = np.zeros(nearest.max() + 1, np.intp)
    of_label[nearest[known]] = np.flatnonzero(known)
    return np.clip(np.rint(rgb.reshape(-1, 3)[of_label[nearest]]), 0, 255).astype(np.uint8)


def _part_with(pixels: NDArray[np.bool_], core: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The connected part (height, width) that has most of the core, with all that it encloses, as a print."""
    labels = np.asarray(cv2.connectedComponents(pixels.view(np.uint8), connectivity=4)[1])
    part = labels == 1 + np.argmax(np.bincount(labels[core & pixels])[1:])
    outlines, _ = cv2.findContours(part.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros(part.shape, np.uint8)
    cv2.drawContours(filled, outlines, -1, (1,), cv2.FILLED)
    return filled.view(np.bool_)
