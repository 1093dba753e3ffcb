"""Keypoints of the appearance of a mesh, recognised in an image however far the surface has moved or turned.

Patches are found within some pixels (`terms.photometric.matching`). After a large motion, or when a lost surface is
found again, the print is further away. The surroundings of its keypoints are described independently of place, turn and
scale, so that each is recognised by itself (`sift`). A surface without print has none.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.perspective import project_with_jacobian
from abs_service.tracker.terms.linearization import PointLinearization
from abs_service.tracker.terms.places.sift import Grey, detect, match
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import LensError

#: Fewer that are recognised may be wrong matches.
MIN_RECOGNIZED = 12

#: Standard deviation of the place of a recognised keypoint [px].
SIGMA_PX = 1.5

#: Keypoints of a bent surface are this near to those of the same surface, flat and rigidly moved [px].
RIGID_PX = 40.0

#: Vertices around a keypoint that tell its place.
_AROUND = 4


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """Keypoints of a mesh.

    Attributes:
        corners: vertices (k, 4) around each of them.
        weights: their shares (k, 4) in its place; the sum is 1.
        descriptors: (k, 128).
    """

    corners: NDArray[np.intp]
    weights: NDArray[np.float64]
    descriptors: NDArray[np.float32]


NOT_YET = Described(np.zeros((0, _AROUND), np.intp), np.zeros((0, _AROUND)), np.zeros((0, 128), np.float32))


class Keypoints:
    """The keypoints of a mesh in the images of one sensor: those of the first image of an estimate.

    Attributes:
        camera: of the images.
        known: the keypoints; `NOT_YET` before the first estimate.
    """

    def __init__(self, camera: Camera):
        self.camera = camera
        self.known = NOT_YET

    def observe(self, grey: Callable[[], Grey], predicted: Surface) -> "ObservedKeypoints":
        """The keypoints in an image, which `grey` tells when they are asked for, around a predicted mesh."""
        return ObservedKeypoints(self, grey, predicted)


class ObservedKeypoints:
    """The keypoints of a mesh in one image."""

    def __init__(self, keypoints: Keypoints, grey: Callable[[], Grey], predicted: Surface):
        self._keypoints = keypoints
        self._grey = grey
        self._predicted = predicted

    def learn(self, surface: Surface) -> None:
        """Takes the keypoints of an estimate, a population of one, from its first image."""
        if self._keypoints.known is not NOT_YET:
            return
        vertices, normals = (part[0].T.astype(np.float64) for part in (surface.vertices, surface.normals))
        camera = self._keypoints.camera
        places = camera.project(vertices)
        found, descriptors = detect(self._grey(), places)
        places[np.vecdot(normals, vertices - camera.center) >= 0] = np.nan  # turned away
        self._keypoints.known = _bound(found, descriptors, places)

    @cached_property
    def recognized(self) -> "Recognized":
        """The keypoints that are recognised in the image."""
        camera, known = self._keypoints.camera, self._keypoints.known
        if len(known.descriptors) < MIN_RECOGNIZED:
            return NOTHING_RECOGNIZED
        places = camera.project(self._predicted.vertices[0].T.astype(np.float64))
        found, descriptors = detect(self._grey(), places)
        which, of_found = match(known.descriptors, descriptors)
        if len(which) < MIN_RECOGNIZED:
            return NOTHING_RECOGNIZED
        return Recognized(camera, known.corners[which], known.weights[which], found[of_found])


@dataclass(frozen=True, slots=True, eq=False)
class Recognized:
    """Keypoints of a mesh that are recognised in an image: `MIN_RECOGNIZED` or more, or none.

    Attributes:
        camera: of the image.
        corners, weights: see `Described`.
        seen: where they are in the image (k, 2) [px].
    """

    camera: Camera
    corners: NDArray[np.intp]
    weights: NDArray[np.float64]
    seen: NDArray[np.float64]

    def apart(self, vertices: NDArray[np.float64]) -> float:
        """Median distance of the keypoints of a mesh (n, 3) [m] from where they are seen [px]; infinite without any.

        Of `MIN_RECOGNIZED` keypoints the largest: so many have to be right.
        """
        if not len(self.seen):
            return np.inf
        miss = np.linalg.norm(self.camera.project(self._points(vertices)) - self.seen, axis=1)
        most = max(len(miss) // 2, MIN_RECOGNIZED - 1)
        return float(np.sort(np.nan_to_num(miss, nan=np.inf))[most])

    def moved(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vertices (n, 3) [m] of a mesh, rigidly moved to where most of its keypoints are seen; NaN if none tells."""
        try:
            rays = self.camera.directions(self.seen)
        except LensError:  # at the image's corners
            return np.full_like(vertices, np.nan)
        found, rotation, shift, _ = cv2.solvePnPRansac(
            self._points(vertices),
            np.ascontiguousarray(rays[:, :2] / rays[:, 2:]),
            np.eye(3),
            None,
            reprojectionError=RIGID_PX / self.camera.fx,
        )
        if not found:
            return np.full_like(vertices, np.nan)
        T_sm = pose.from_rotation_vector(rotation.ravel(), shift.ravel())
        return pose.transform(self.camera.T_rs @ T_sm, vertices)

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> PointLinearization:
        """Residuals of the places of a population of one, two for each keypoint.

        Those that are far beside all others weigh little (Geman–McClure), by the median of their distances.
        """
        vertices = surface.vertices[0].T.astype(np.float64)
        places, jacobian = project_with_jacobian(self.camera, self._points(vertices))
        residual = places - self.seen
        apart = np.linalg.norm(residual, axis=1)
        use = np.flatnonzero(np.isfinite(apart))
        if not len(use):
            return PointLinearization.empty(sparse_jacobian)
        scale = max(2 * float(np.median(apart[use])), 2 * SIGMA_PX)
        weight = 1 / ((1 + (apart[use] / scale) ** 2) * SIGMA_PX)
        nearest = self.corners[use, self.weights[use].argmax(axis=1)]  # its Jacobian is about that of the keypoint
        rows = (jacobian[use] * weight[:, None, None]).reshape(-1, 3)
        return PointLinearization(
            (residual[use] * weight[:, None]).ravel(), rows, np.repeat(nearest, 2), sparse_jacobian, vertices
        )

    def _points(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.einsum("kij,ki->kj", vertices[self.corners], self.weights)


#: Of a sensor without appearance, of a surface without print, or of one that is hidden.
NOTHING_RECOGNIZED = Recognized(Camera(1, 1, 1.0, 1.0, 0.0, 0.0), NOT_YET.corners, NOT_YET.weights, np.zeros((0, 2)))


def _bound(found: NDArray[np.float64], descriptors: NDArray[np.float32], places: NDArray[np.float64]) -> Described:
    """The keypoints at pixels (k, 2) that lie on a mesh, as means of the vertices around them.

    Args:
        found: the keypoints.
        descriptors: theirs (k, 128).
        places: of the vertices (n, 2) [px]; NaN where the camera does not see them.
    """
    visible = np.flatnonzero(np.isfinite(places).all(axis=1))
    if not len(found) or len(visible) < _AROUND:
        return replace(NOT_YET)  # known to be none
    tree = scipy.spatial.KDTree(places[visible])
    spacing = float(np.median(tree.query(places[visible], 2)[0][:, 1]))
    distance, nearest = tree.query(found, _AROUND)
    corners = visible[nearest]
    # Weights of least squares among those with the place and the sum: equal ones in the middle of a cell.
    system = np.concatenate([places[corners], np.ones((*corners.shape, 1))], axis=2).swapaxes(1, 2)
    system[:, :2] -= found[:, :, None]
    weights = np.asarray(np.linalg.pinv(system)[..., 2], np.float64)
    exact = np.abs(np.einsum("kij,kj->ki", system[:, :2], weights)).max(axis=1) < 0.5
    on_mesh = exact & (distance[:, 0] < spacing) & (np.abs(weights).max(axis=1) < 2)
    return Described(corners[on_mesh], weights[on_mesh], descriptors[on_mesh])
