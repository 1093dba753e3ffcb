"""Alignment of an image with the distances: a wrong calibration shows where the two have edges.

Where the distance jumps, most images have an edge, too. Each jump is looked up in the image by the calibration, and the
edges around all of them are added up: they pile up where the image really has the jumps, displaced as by a camera with
another focal length and principal point. Print and shadows are edges without a jump, and some jumps show no edge, so
nearly every half of the jumps has to show the same displacement.
"""

from collections.abc import Mapping
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import ChannelImage, ColorImage, Image
from abs_service.tracker.detection.initial_detection import InitialDetection
from calib.camera import Camera
from calib.pose import transform
from calib.rig import Rig

#: Images are reduced to about this width [px]: distances have no finer edges.
WIDTH = 320

#: Largest displacement that is looked for [px of the reduced image], and the factors on the focal lengths.
REACH = 16
SCALES = 1.02 ** np.arange(-6.0, 7.0)

#: Minimum length of a displacement [px of the reduced image, root mean square over the jumps]. Structured
#: light makes things two or three pixels wider, and calibrations that were fitted to one scene are off by as much.
MIN_DISPLACEMENT_PX = 4.0

#: Least number of standard deviations by which it stands out from all others that are looked for; least share of
#: random halves of the cells that agree with it, number of such halves, and their largest distance from it [px, root
#: mean square]. Of 2033 depth images, each beside an image of another scene, 22 reach the first limit, three the
#: second, and none both.
DEVIATIONS, SHARE, HALVES, AGREEMENT = 6.0, 0.9, 60, 3.0

#: A jump is larger than this share of the distance, and than this [m]: steps and noise are not.
JUMP, MIN_JUMP_M = 0.03, 0.02

#: Length of a line of pixels along a jump [px]; a jump that is not on most of it is a wrong distance.
LINE = 7

#: What is behind appears within this share of the image's width: at a jump, sensors have no returns, or mixed ones.
GAP = 1 / 40

#: How many jumps are compared at most, cells along a row of the image, and least number of cells with jumps: those
#: within one are no independent witnesses.
MAX_JUMPS, CELLS, MIN_CELLS = 800, 10, 8

#: An edge counts by its strength over the typical one nearby, at most this, and weaker ones than a share of all less.
MAX_STRENGTH, WEAK = 3.0, 0.2

#: Largest displacement of the image's edges by other focal lengths [px of the reduced image].
_MARGIN = round(0.13 * WIDTH / 2)
_SIDE = 2 * (REACH + _MARGIN) + 1


class Displacement(NamedTuple):
    """Displacement of an image's edges from where a camera has the jumps of the distances.

    Attributes:
        px: its length, root mean square over the jumps [px].
        scale: factor on the focal lengths with which it would vanish.
        shift: what had to be added to the principal point besides (2,) [px].
    """

    px: float
    scale: float
    shift: NDArray[np.float64]


def alignment_warnings(detection: InitialDetection, images: Mapping[str, Image], rig: Rig) -> tuple[str, ...]:
    """Doubts about the calibration of the cameras, in plain words."""
    pictures = {name: image for name, image in images.items() if isinstance(image, (ColorImage, ChannelImage))}
    doubts = {name: _doubt(detection, image, rig.sensors[name].camera) for name, image in pictures.items()}
    return tuple(f"the edges in the image of {name} lie {doubt}" for name, doubt in doubts.items() if doubt)


def _doubt(detection: InitialDetection, image: ColorImage | ChannelImage, camera: Camera) -> str:
    """The place of an image's edges in words, "" if it is right or unknown."""
    found = displacement(detection, image, camera)
    if _is_small(found, image):
        return ""
    if _is_small(displacement(detection, _mirrored(image), camera), image):
        return "where the distances have them only if left and right are exchanged: is one of the two mirrored?"
    if found is None:
        return ""
    return (
        f"{found.px:.0f} px beside those in the distances (fx and fy × {found.scale:.2f}, cx {found.shift[0]:+.0f} and "
        f"cy {found.shift[1]:+.0f} would bring them together): is its calibration that of images of this size, its "
        "pose T_rs that from sensor to rig and not the other way round, and are both of the same moment?"
    )


def _is_small(found: Displacement | None, image: ColorImage | ChannelImage) -> bool:
    """True if an image has been seen to have its edges where the distances jump."""
    return found is not None and found.px < MIN_DISPLACEMENT_PX * _factor(image)


def _mirrored(image: ColorImage | ChannelImage) -> ColorImage | ChannelImage:
    if isinstance(image, ColorImage):
        return ColorImage(np.ascontiguousarray(image.rgb[:, ::-1]))
    return ChannelImage(np.ascontiguousarray(image.values[:, ::-1]), image.channels)


def _factor(image: ColorImage | ChannelImage) -> int:
    """Factor by which an image is reduced."""
    if isinstance(image, ColorImage):
        return max(round(image.rgb.shape[1] / WIDTH), 1)
    return max(round(image.values.shape[1] / WIDTH), len(image.channels))


def displacement(detection: InitialDetection, image: ColorImage | ChannelImage, camera: Camera) -> Displacement | None:
    """Displacement of an image's edges from the jumps of the distances, of any length; None if too little tells.

    Args:
        detection: the distances, of the same moment.
        image: of the same scene.
        camera: that took it, as far as one knows.
    """
    pixels = image.rgb if isinstance(image, ColorImage) else image.values
    factor = _factor(image)
    size = pixels.shape[1] // factor, pixels.shape[0] // factor
    places, is_along_row = _seen(detection, camera, factor, size)
    _, cell, counts = np.unique(places * CELLS // size[0], axis=0, return_inverse=True, return_counts=True)
    if len(counts) < MIN_CELLS:
        return None
    small = cv2.resize(np.ascontiguousarray(pixels), size, interpolation=cv2.INTER_AREA)
    edges = _edges(np.asarray(small, np.float32).reshape(*size[::-1], -1))
    sums, means = np.zeros((len(counts), _SIDE, _SIDE), np.float32), np.zeros((len(counts), 2))
    np.add.at(means, cell, places / counts[cell, None])
    for (column, row), along_row, own in zip(np.round(places).astype(np.intp), is_along_row, cell):
        sums[own] += edges[0 if along_row else 1][row : row + _SIDE, column : column + _SIDE]
    found = _common(sums, means - _reduced(np.array([camera.cx, camera.cy]), factor), counts)
    return None if found is None else Displacement(found.px * factor, found.scale, found.shift * factor)


def _jumps(distance: NDArray[np.float32]) -> NDArray[np.intp]:
    """Pixels before a jump, column and row, and the step (1 px) that crosses it (k, 4).

    Args:
        distance: radial distances (height, width) [m], NaN without return.
    """
    here, gap = np.nan_to_num(distance), max(2, round(GAP * distance.shape[1]))
    jump, found = np.maximum(JUMP * here, MIN_JUMP_M), []
    for right, down in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        before, last, after = (_beside(here, steps * right, steps * down) for steps in (-2, -1, 1))
        line = np.zeros((2 * gap + 1, 2 * gap + 1), np.uint8)
        line[gap + down * np.arange(1, gap + 1), gap + right * np.arange(1, gap + 1)] = 1
        farthest = cv2.dilate(here, line, borderType=cv2.BORDER_CONSTANT, borderValue=0)
        is_smooth = (np.abs(last - here) < jump) & (np.abs(before - here) < jump)
        is_end = (after == 0) | (after > here + jump)
        is_jump = (here > 0) & (np.asarray(farthest) > here + jump) & is_smooth & is_end
        beside = 3 * abs(right) + LINE * abs(down), 3 * abs(down) + LINE * abs(right)
        number = cv2.boxFilter(is_jump.astype(np.float32), -1, beside, normalize=False, borderType=cv2.BORDER_CONSTANT)
        rows, columns = np.nonzero(is_jump & (np.asarray(number) > 0.6 * LINE))
        found.append(np.stack([columns, rows, np.full_like(rows, right), np.full_like(rows, down)], axis=1))
    return np.concatenate(found)


def _beside(values: NDArray[np.float32], right: int, down: int) -> NDArray[np.float32]:
    """Image (height, width) shifted left by `right` and up by `down` pixels; 0 where it was outside."""
    move = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
    moved = cv2.warpAffine(values, move, values.shape[::-1], flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP)
    return np.asarray(moved, np.float32)


def _seen(
    detection: InitialDetection, camera: Camera, factor: int, size: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Pixels (k, 2) of its reduced image where a camera has some of the jumps, and if rows of it cross them (k,)."""
    jumps = _jumps(detection.surroundings)
    jumps = jumps[np.linspace(0, len(jumps) - 1, min(len(jumps), MAX_JUMPS)).astype(np.intp)]
    distance = detection.surroundings[jumps[:, 1], jumps[:, 0], None]

    def points(steps: float) -> NDArray[np.float64]:
        rays = detection.camera.directions(jumps[:, :2] + steps * jumps[:, 2:])
        return transform(detection.camera.T_rs, distance * rays)

    is_inside = camera.in_field(points(0.5))
    places, before = (_reduced(camera.project(points(steps)), factor) for steps in (0.5, -0.5))
    is_inside &= np.all((places >= 0) & (places <= np.array(size) - 1), axis=1)
    along, across = np.abs(places - before)[is_inside].T
    return places[is_inside], along >= across


def _reduced(pixels: NDArray[np.float64], factor: int) -> NDArray[np.float64]:
    """Pixels (…, 2) of an image that is reduced by a factor."""
    return (pixels - (factor - 1) / 2) / factor


def _edges(image: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Edges that rows cross, and that columns cross, 0 on average, with a border of half of `_SIDE`.

    Args:
        image: (height, width, channels), NaN where unknown.
    """
    smooth, found = np.asarray(cv2.GaussianBlur(np.nan_to_num(image), (0, 0), 1.0)), []
    for right, down in ((1, 0), (0, 1)):
        slope = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, right, down, ksize=1)).reshape(image.shape)
        square = np.sum(np.square(slope), axis=2)
        around = np.maximum(cv2.blur(square, (_SIDE, _SIDE)), np.finfo(np.float32).tiny)  # running sums err below 0
        typical = np.sqrt(around) + WEAK * np.sqrt(square.mean())
        edge = np.minimum(np.sqrt(square) / typical, MAX_STRENGTH)
        found.append(np.pad(edge - cv2.blur(edge, (_SIDE, _SIDE)), _SIDE // 2))
    return found


def _common(sums: NDArray[np.float32], off: NDArray[np.float64], counts: NDArray[np.intp]) -> Displacement | None:
    """The displacement that the halves of the cells agree on [px of the reduced image].

    Args:
        sums: edges around the jumps of each cell (cells, side, side).
        off: of each cell from the principal point (cells, 2) [px].
        counts: of jumps in each (cells,).
    """
    piles = np.zeros((len(sums), len(SCALES), 2 * REACH + 1, 2 * REACH + 1), np.float32)
    for values, place, own in zip(sums, off, piles):
        for scale, pile in zip(SCALES, own):
            move = np.column_stack([np.eye(2), _MARGIN + (scale - 1) * place])
            pile[:] = cv2.warpAffine(values, move, pile.shape, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)

    def length(moves: NDArray[np.float64]) -> float:
        return float(np.sqrt(np.average(np.sum(moves**2, axis=1), weights=counts)))

    total = piles.sum(axis=0)
    scale, shift = _highest(total)
    moves = shift + (scale - 1) * off
    if total.max() <= DEVIATIONS * total.std():
        return None
    order = np.random.default_rng(0).permuted(np.tile(np.arange(len(piles)), (HALVES, 1)), axis=1)
    halves = np.tensordot((order < len(piles) / 2).astype(np.float32), piles, axes=1)
    others = (other_shift + (other_scale - 1) * off for other_scale, other_shift in map(_highest, halves))
    near = np.mean([length(other - moves) <= AGREEMENT for other in others])
    return Displacement(length(moves), scale, shift) if near >= SHARE else None


def _highest(pile: NDArray[np.float32]) -> tuple[float, NDArray[np.float64]]:
    """Scale and shift (2,) [px] of the largest of all (scales, side, side)."""
    scale, row, column = np.unravel_index(pile.argmax(), pile.shape)
    return float(SCALES[scale]), np.array([column - REACH, row - REACH], np.float64)
