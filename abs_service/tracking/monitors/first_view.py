"""The image from which a mesh was made: whether it hid what is found beside the mesh later."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.depth_view import at_points
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh
from calib.pose import nearest_rotation

#: Share of the vertices that may have been in sight beside the object: the region leaves out pixels at its rim.
_MAX_BESIDE = 0.1

#: Distances that differ by less are of one surface [m], and so are shapes, by this share of their size.
_SAME_M, _SAME_SHAPE = 0.02, 0.02


class FirstView:
    """The object in the image from which its mesh was made."""

    def __init__(self, detection: InitialDetection, mesh: Mesh):
        self._detection, self._vertices = detection, mesh.vertices

    def hid(self, found: Mesh, vertices: NDArray[np.floating]) -> bool:
        """True if what is found is the object with sides that were behind it in the first image.

        What touches the object since then was beside it, where the first image shows something farther away. An object
        that bends is not judged.

        Args:
            found: what is found now, with the object.
            vertices: the mesh of the object at the same time (n, 3) [m].
        """
        around, camera = self._detection.surroundings, self._detection.camera
        center, place = vertices.mean(axis=0), self._vertices.mean(axis=0)
        turn = nearest_rotation((self._vertices - place).T @ (vertices - center))
        off = (vertices - center) @ turn.T + place - self._vertices
        if not around.size or np.sqrt((off**2).mean()) > _SAME_SHAPE * self._vertices.std(axis=0).max():
            return False
        at_first = (found.vertices - center) @ turn.T + place
        distance = np.linalg.norm(at_first - camera.center, axis=1)
        nearest = at_points(around, camera, at_first)
        shown = np.isfinite(at_points(self._detection.distance, camera, at_first))
        with np.errstate(invalid="ignore"):
            explained = (nearest < distance - _SAME_M) | shown & (nearest < distance + _SAME_M)
        return bool(np.mean(~explained) < _MAX_BESIDE)
