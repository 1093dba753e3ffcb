"""Search for the appearance of a mesh in an image: patches are shifted until they agree with it.

Gradients of an image hold within a pixel or two of a fine print. A mesh that lies further beside it, after a sudden
motion or behind an occluder, ends in a minimum of the cost that is not the least. So all shifts of a patch of samples
within some pixels are compared, as in block matching (J. Jain, A. Jain: Displacement measurement and its application in
interframe image coding. IEEE Transactions on Communications 29, 1981), by the cost that the samples have there.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.base import Synthesis
from abs_service.tracker.terms.linearization import PointLinearization
from abs_service.tracker.terms.places.patches import NEAR_PX, Patches, found_at
from calib.camera import Camera

#: Largest shift of a patch to the right or down [px], and largest number of its samples that are compared.
REACH_PX, MAX_SAMPLES = 8, 40

#: A shift that is less likely by this is another one [nats]; of two places that differ by less, either may be right.
SIGNIFICANT, AMBIGUOUS = 20.0, 10.0

#: Cost (s,) [nats] of samples at pixels (s, k) of the texture with a border, with attributes (s or 1, channels, k), and
#: which samples these are (k,). An infinite attribute costs as much as an inlier on average.
Costs = Callable[[NDArray[np.int32], NDArray[np.float32], NDArray[np.intp]], NDArray[np.float64]]

#: Texture, two arrays of noise with a row for each sample or one for all, and the costs of outliers and of the unseen.
Measured = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], float, float]

_STEPS = np.arange(-REACH_PX, REACH_PX + 1, dtype=np.int32)
#: All shifts (s, 2), right and down [px], and the index of the one by nothing.
_SHIFTS = np.stack([part.ravel() for part in np.meshgrid(_STEPS, _STEPS)], axis=1)
_STILL = len(_SHIFTS) // 2


def costs_of(kernel: Callable[..., None], measured: Callable[[NDArray[np.int32]], Measured]) -> Costs:
    """Costs by a kernel of (pixel, attributes, *measured, result) that sums over as many samples as it is given."""

    def costs(
        pixel: NDArray[np.int32], attributes: NDArray[np.float32], samples: NDArray[np.intp]
    ) -> NDArray[np.float64]:
        texture, scale, normalizer, outlier, unseen = measured(pixel)
        out, own = np.empty(len(pixel)), samples % len(scale)
        kernel(pixel, attributes, texture, scale[own], normalizer[own], outlier, unseen, out)
        return out

    return costs


def matched(
    camera: Camera,
    surface: Surface,
    sparse_jacobian: SparseJacobian,
    seen: Synthesis,
    patches: Patches,
    shape: tuple[int, ...],
    costs: Costs,
) -> PointLinearization:
    """Residuals of the places in the image, two for each sample, whose patch is found there; see `Term.match`."""
    of_samples = np.argmax(seen.interpolation.spread(np.eye(int(patches.max()) + 1)[patches]), axis=1)
    shift = _shifts(seen, (shape[0], shape[1]), of_samples, costs)
    found = np.isfinite(shift[:, 0]).nonzero()[0]
    vertices = seen.interpolation.spread(surface.vertices[0].T)
    return found_at(camera, vertices, found, shift[found], seen.interpolation.follow(sparse_jacobian))


def _shifts(seen: Synthesis, shape: tuple[int, int], of_samples: NDArray[np.intp], costs: Costs) -> NDArray[np.float64]:
    """Shift (m, 2) [px] of samples to where the image shows their appearance, right and down; NaN where unknown.

    Patches that noise explains where they are are not looked for.

    Args:
        seen: the samples of a population of one.
        shape: of the image without its border (height, width).
        of_samples: patch (m,) of every sample.
        costs: of samples at other pixels.
    """
    result, some = np.full((len(of_samples), 2), np.nan), _some_of_each(of_samples, seen.pixel[0] > 0)
    if not len(some):
        return result
    attributes, places = np.ascontiguousarray(seen.attributes[:, :, some]), seen.pixel[0, some]
    is_own = of_samples[some] == np.arange(int(of_samples.max()) + 1)[:, None]
    own = np.where(is_own, places, np.int32(-1))  # a patch for a candidate: there are no samples of the others
    still, explained = costs(own, attributes, some), costs(own, np.full_like(attributes, np.inf), some)
    for patch in (still - explained > SIGNIFICANT).nonzero()[0]:
        of_patch = is_own[patch]
        alone = np.ascontiguousarray(attributes[:, :, of_patch])
        result[of_samples == patch] = _best(costs(_shifted(places[of_patch], shape), alone, some[of_patch]))
    result[seen.pixel[0] <= 0] = np.nan
    return result


def _some_of_each(of_samples: NDArray[np.intp], in_sight: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Indices (k,) of no more than `MAX_SAMPLES` samples in sight (m,) of every patch, evenly spaced in their order."""
    samples = in_sight.nonzero()[0]
    samples = samples[of_samples[samples].argsort(kind="stable")]
    patch = of_samples[samples]
    count = np.bincount(patch)
    place = np.arange(len(samples)) - (count.cumsum() - count)[patch]  # within its patch
    return samples[place % -(-count // MAX_SAMPLES)[patch] == 0]


def _best(costs: NDArray[np.float64]) -> NDArray[np.float64]:
    """The shift (2,) [px] of least cost, of costs (s,); 0 if that is hardly worse; NaN if other places are as good."""
    best = int(np.argmin(costs))
    if costs[_STILL] - costs[best] < SIGNIFICANT:
        best = _STILL
    row, column = divmod(best, len(_STEPS))
    elsewhere = costs.reshape(len(_STEPS), -1).copy()
    elsewhere[max(row - NEAR_PX, 0) : row + NEAR_PX + 1, max(column - NEAR_PX, 0) : column + NEAR_PX + 1] = np.inf
    if elsewhere.min() - costs[best] < AMBIGUOUS:
        return np.full(2, np.nan)
    return _SHIFTS[best].astype(np.float64)


def _shifted(pixel: NDArray[np.int32], shape: tuple[int, int]) -> NDArray[np.int32]:
    """Pixels (s, k) of all shifts; 0, in the border, outside the image."""
    height, width = shape
    row, column = np.divmod(pixel, width + 2)
    right, down = _SHIFTS[:, :1], _SHIFTS[:, 1:]
    places = pixel + (down * np.int32(width + 2) + right)
    if min(row.min(), height + 1 - row.max(), column.min(), width + 1 - column.max()) > REACH_PX:
        return places
    rows, columns = row + down, column + right
    return np.where((rows > 0) & (rows <= height) & (columns > 0) & (columns <= width), places, np.int32(0))
