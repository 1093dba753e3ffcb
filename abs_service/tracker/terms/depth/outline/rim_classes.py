"""Classes of a mesh's rim in the first depth image: where the object ends, and where only the mesh does."""

from collections.abc import Callable
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import Surface
from abs_service.tracker.terms.base import line_of_sight
from abs_service.tracker.terms.depth.classification.beyond_view import BLIND_SHARE, MIN_RETURNS
from abs_service.tracker.terms.depth.outline.rim import Rim, read
from abs_service.tracker.terms.depth.outline.round_side import is_round_side
from abs_service.tracker.terms.sensor_fit import MIN_RIM
from calib.camera import Camera
from calib.jit import kernel

#: Largest gap from the outermost vertices to the end of the object, in their distances from the next ones (steps).
MAX_GAP_STEPS = 2.0

#: Largest distance of the outline from the extrapolated end of the object, if that is to be known [px].
MAX_MISS_PX = 4.0

#: Points beyond an edge, in steps; what is in front of one of them hides the edge.
_HIDING_STEPS = (0.5, 1.0, 1.5, MAX_GAP_STEPS)

#: Reach beyond the outline of a shadow without return, cast by something in front of the object, in steps.
_SHADOW_STEPS = 0.5

#: A surface that is seen at a smaller cosine at its rim turns away from the sensor: the outline is a silhouette, which
#: wanders over a body as it turns, not the end of a sheet.
MIN_COSINE = 0.25

#: All of an outline is one where a surface bulges: most normals lean outwards by 37° or more (sine 0.6), and to all
#: sides. A sheet bends to two sides only. A direction has at least so great a share of the leaning.
_LEANING, _MIN_SHARE, _MIN_DIRECTION = 0.6, 0.75, 0.25

#: Distance of the measurement from the extrapolated mesh, most of the way to the outline, beyond which the surface ends
#: before it [m]; number of neighbouring edges at most of which it is so. At the edge of a table top, its side follows.
LEAVES_M = 0.015
_NEIGHBOURS = 7
_ALMOST = 0.75

#: A body with a smaller share of free edges in its outline is round for the most part; those few belong to it as well.
MIN_FREE = 0.25

#: Distance from the image's border within which the object may continue beyond it [px].
BORDER_PX = 2.0


class RimClass(IntEnum):
    """Reason why the mesh ends at a vertex."""

    FREE = 0  # the object ends: beside it there is a background, or no return
    CONTACT = 1  # measured surface goes on: another object or side, a mask cuts this one, or its mesh ends far inside
    SILHOUETTE = 2  # the surface turns away from the sensor
    OCCLUDED = 3  # an occluder lies before it, or the measurement has a hole
    BORDER = 4  # the image ends: on what comes into it, the mesh may go on as beyond an occluder


def classify_rim(
    camera: Camera,
    rim: Rim,
    surface: Surface,
    inside: NDArray[np.float64],
    gradients: NDArray[np.float64],
    inside_at: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    distance: NDArray[np.float32],
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """`RimClass` (k,) of the outer vertices, and the gap (k,) between them and the end of the object.

    The gap is relative to the distance from the inner vertex; 0 unless the class is FREE, and where the object is known
    to end at the outer vertices.

    Args:
        camera: the depth camera.
        rim: outermost vertices.
        surface: the mesh in the first image, a population of one.
        inside: distances (k,) of the outermost vertices inside the outline [px], huge where unknown.
        gradients: image gradients of these distances (k, 2).
        inside_at: distances (k,) of points (k, 3) inside it, −∞ far outside, NaN where unknown.
        distance: measured radial distances (height, width) [m], NaN without return.
    """
    outer, inner = (surface.vertices[0].T[which].astype(np.float64) for which in (rim.outer, rim.inner))
    place, step = camera.project(outer), outer - inner
    beyond = _steps_to_outline(inside, gradients, place - camera.project(inner))
    ends_near = beyond <= MAX_GAP_STEPS
    gap = np.where(ends_near, np.maximum(beyond, 0.0), 0.0)
    ends = outer + gap[:, None] * step
    # If the mesh ends far inside the object, or the outline bends, it is nearest elsewhere than where the edge points.
    ends_elsewhere = (np.abs(inside_at(ends)) > MAX_MISS_PX) & (gap > 0)
    goes_on = ~ends_near | ends_elsewhere
    far = ~goes_on & (inside > MAX_MISS_PX) & (not rim.is_end)
    goes_on[far] = _leaves(camera, (outer + _ALMOST * gap[:, None] * step)[far], distance)
    hidden, unseen = _unseen(camera, [outer + by * step for by in _HIDING_STEPS], inside_at)
    goes_on |= hidden & (unseen == RimClass.OCCLUDED) & _is_missing(camera, ends + _SHADOW_STEPS * step, distance)
    turned = turns_away(camera, surface, rim.outer, rim.inner)
    unknown = inside > camera.width + camera.height
    at_border = ~_is_within(camera, place, BORDER_PX)
    cut = _ends_at_border(camera.project(ends), distance) & (not rim.is_end)
    classes = np.select(  # the first that holds
        [at_border, unknown, turned, goes_on & hidden, goes_on, cut],
        [RimClass.BORDER, unseen, RimClass.SILHOUETTE, unseen, RimClass.CONTACT, RimClass.BORDER],
        RimClass.FREE,
    ).astype(np.uint8)
    free = classes == RimClass.FREE
    round_sides = is_round_side(camera, distance, place, inside, gradients)
    round_sides |= _bulges(camera, surface, rim.outer[free], -gradients[free])
    classes[free & round_sides] = RimClass.SILHOUETTE
    classes[(classes == RimClass.FREE) & _are_few(classes)] = RimClass.CONTACT
    gap[(classes != RimClass.FREE) | rim.is_end] = 0.0
    return classes, gap.astype(np.float32)


def turns_away(camera: Camera, surface: Surface, outer: NDArray[np.intp], inner: NDArray[np.intp]) -> NDArray[np.bool_]:
    """True for edges (k,) of a population of one at which the surface turns away from a camera: what ends is its image.

    Extrapolated to the end of the surface, which lies about as far outside the outer vertex as the inner one inside.
    """
    result = np.empty(len(outer), np.bool_)
    _turn_away(surface.vertices[0], surface.normals[0], camera.center, outer, inner, result)
    return result


def _are_few(classes: NDArray[np.uint8]) -> bool:
    """True if so few are free edges that the status could not tell that they lie off the outline.

    So it is beside specks of relief and quantised distances, and at the ends of a round body.
    """
    free, silhouettes = (np.count_nonzero(classes == one) for one in (RimClass.FREE, RimClass.SILHOUETTE))
    return bool(free < max(MIN_RIM, MIN_FREE * (free + silhouettes)))


def _steps_to_outline(
    inside: NDArray[np.float64], gradients: NDArray[np.float64], step_px: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Number of steps (k, 2) [px] outwards that lead to the outline (k,), see `classify_rim`; ∞ for one inwards."""
    per_step = -np.einsum("ki,ki->k", gradients, step_px)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(per_step > 0, inside / per_step, np.inf)


def _unseen(
    camera: Camera, further: list[NDArray[np.float64]], inside_at: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """True (k,) where some of the points (k, 3) beyond edges are unknown, and the class (k,) that these then have."""
    hidden = np.any([np.isnan(inside_at(points)) for points in further], axis=0)
    leaves = np.any([~_is_within(camera, camera.project(points)) for points in further], axis=0)
    return hidden, np.where(leaves, RimClass.BORDER, RimClass.OCCLUDED)


def _is_missing(camera: Camera, points: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
    """True for points (k, 3) in an image (height, width) that has no return there."""
    last = distance.shape[1] - 1, distance.shape[0] - 1
    return np.isnan(read(distance, np.zeros(2, np.float32), camera.project(points), last))


def _is_within(camera: Camera, places: NDArray[np.float64], margin: float = 0.0) -> NDArray[np.bool_]:
    """True for places (k, 2) in a camera's image that are so far from its border [px]."""
    last = np.array([camera.width, camera.height]) - 1
    return np.all((places >= margin) & (places <= last - margin), axis=1)


def _ends_at_border(places: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
    """True for places (k, 2) at the border of what is measured of an image (height, width): an end there is none.

    Its rows and columns are measured for the most part: what is alone before no return ends by itself.
    """
    known = np.isfinite(distance)
    at_border = np.zeros(len(places), np.bool_)
    for axis, size in enumerate(known.shape[::-1]):
        lines = np.flatnonzero(known.mean(axis=axis) >= MIN_RETURNS)
        first = min(lines[lines <= BLIND_SHARE * size], default=0)
        last = max(lines[lines >= (1 - BLIND_SHARE) * size], default=size - 1)
        at_border |= (places[:, axis] < first + MAX_MISS_PX) | (places[:, axis] > last - MAX_MISS_PX)
    return at_border


def _bulges(camera: Camera, surface: Surface, outer: NDArray[np.intp], outwards: NDArray[np.float64]) -> bool:
    """True if the normals of rim vertices (k,) lean in most of their directions outwards in the image (k, 2) [px]."""
    if len(outer) < MIN_RIM:
        return False
    sight = surface.vertices[0].T[outer].astype(np.float64) - camera.center
    normals = surface.normals[0].T[outer].astype(np.float64)
    normals *= -np.sign(np.vecdot(normals, sight))[:, None]
    sight /= np.linalg.norm(sight, axis=1)[:, None]
    across = (normals - np.vecdot(normals, sight)[:, None] * sight) @ camera.T_rs[:3, :3]
    outwards = outwards / np.maximum(np.linalg.norm(outwards, axis=1), np.finfo(float).tiny)[:, None]
    leaning = np.vecdot(across[:, :2], outwards) > _LEANING
    if np.mean(leaning) < _MIN_SHARE:
        return False
    shares = np.linalg.eigvalsh(outwards[leaning].T @ outwards[leaning] / np.count_nonzero(leaning))
    return bool(shares[0] > _MIN_DIRECTION)


def _leaves(camera: Camera, points: NDArray[np.float64], distance: NDArray[np.float32]) -> NDArray[np.bool_]:
    """True for points (k, 3) around most of which measured distances (height, width) are off theirs; unknown ones not.

    The median of neighbours is not moved by the noise of the single edges, which extrapolation makes larger.
    """
    (height, width), places = distance.shape, camera.project(points)
    measured = read(distance, np.zeros(2, np.float32), places, (width - 1, height - 1))
    off = measured - np.linalg.norm(points - camera.center, axis=1)
    known = np.isfinite(off)
    apart = np.linalg.norm(places[:, None] - places[known], axis=2)
    near = np.argsort(apart, axis=1, kind="stable")[:, :_NEIGHBOURS]
    return np.abs(np.median(off[known][near], axis=1)) > LEAVES_M if known.any() else np.zeros(len(points), np.bool_)


@kernel
def _turn_away(
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    center: NDArray[np.float64],
    outer: NDArray[np.intp],
    inner: NDArray[np.intp],
    result: NDArray[np.bool_],
) -> None:
    """See `turns_away`; vertices and normals (3, n)."""
    for k in range(outer.size):
        beyond = 0.0
        for v, share in ((outer[k], 2.0), (inner[k], -1.0)):
            distance, along = line_of_sight(vertices, normals, v, center)
            beyond += share * abs(along) / distance
        result[k] = beyond < MIN_COSINE
