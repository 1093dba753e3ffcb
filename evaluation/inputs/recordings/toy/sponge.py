"""Quality of the sponge's mesh in the toy's sequence: folds, stretch, and drift over the image."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from evaluation.inputs.recordings import features
from evaluation.inputs.recordings.binding import bind_rays, normals
from evaluation.inputs.recordings.toy.toy import CAMERA, ReferenceFrame, TrackedFrame

#: Vertices farther than this from what is measured of the object are off it [m].
OFF_M = 0.02


@dataclass(frozen=True)
class MeshState:
    """One frame.

    Attributes:
        forward_mm, backward_mm: residuals as of `Agreement` [mm].
        off: share of the vertices that are off the measured surface, by the nearest of its points.
        inside: share of the vertices that project into the mask.
        folded: share of the faces that are folded.
        edge: 95 % of the edges have changed their length since rest by less than this share of it.
        drift_px: median distance of the bound corners from where the image shows them [px]; NaN without any.
        corners: how many of them are left.
    """

    forward_mm: float
    backward_mm: float
    off: float
    inside: float
    folded: float
    edge: float
    drift_px: float
    corners: int


def states(references: Sequence[ReferenceFrame], frames: Sequence[TrackedFrame]) -> list[MeshState]:
    """Statistics of every frame of a sequence without gaps, tracked with one mesh."""
    first = frames[0]
    mesh, images, masks = first.estimate.vertices, [one.grey for one in references], [one.mask for one in references]
    found = features.tracks(images, masks, features.corners(images[0], masks[0]))
    binding = bind_rays(CAMERA.directions(found[0]), mesh, first.faces)
    result = []
    for reference, frame, places in zip(references, frames, found[:, binding.bound], strict=True):
        vertices = np.asarray(frame.estimate.vertices, np.float64)
        miss = np.linalg.norm(CAMERA.project(binding.points(vertices)) - places, axis=1)
        left = int(np.isfinite(miss).sum())
        result.append(
            MeshState(
                forward_mm=frame.agreement.forward_mm,
                backward_mm=frame.agreement.backward_mm,
                off=float(np.mean(distances(vertices, reference) > OFF_M)),
                inside=frame.agreement.inside,
                folded=float(np.mean(folded(vertices, np.asarray(mesh, np.float64), frame.faces))),
                edge=float(np.quantile(edge_changes(vertices, frame.rest, frame.faces), 0.95)),
                drift_px=float(np.nanmedian(miss)) if left else np.nan,
                corners=left,
            )
        )
    return result


def distances(vertices: NDArray[np.float64], reference: ReferenceFrame) -> NDArray[np.float64]:
    """Distance (n,) [m] of every vertex (n, 3) from the nearest point that is measured of the object."""
    measured = reference.mask & np.isfinite(reference.distance)
    return KDTree(CAMERA.unproject(reference.distance)[measured]).query(vertices)[0]


def folded(vertices: NDArray[np.float64], first: NDArray[np.float64], faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Mask (m,) of the faces that are folded: turned over, seen from the origin, or by more than 90° from a neighbour.

    Args:
        vertices: of the mesh (n, 3) [m].
        first: the same in the first frame: it says which side of a face was seen, and which angles it had before.
        faces: vertex indices (m, 3).
    """
    corners, before = vertices[faces], first[faces]
    now, then = normals(corners), normals(before)
    turned = np.sign(np.sum(now * corners[:, 0], axis=1)) != np.sign(np.sum(then * before[:, 0], axis=1))
    one, other = neighbours(faces)
    sharp = (np.sum(now[one] * now[other], axis=1) < 0) & (np.sum(then[one] * then[other], axis=1) >= 0)
    turned[one[sharp]] = turned[other[sharp]] = True
    return turned


def neighbours(faces: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of faces (k,) and (k,) that share an edge."""
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    face, order = np.tile(np.arange(len(faces)), 3), np.lexsort(sides.T)
    shared = (np.diff(sides[order], axis=0) == 0).all(axis=1)
    return face[order[:-1][shared]], face[order[1:][shared]]


def edge_changes(
    vertices: NDArray[np.float64], rest: NDArray[np.float64], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """|length / length at rest − 1| of every edge (k,)."""
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    one, other = np.unique(sides, axis=0).T
    length, before = (np.linalg.norm(mesh[one] - mesh[other], axis=1) for mesh in (vertices, rest))
    return np.abs(length / before - 1)
