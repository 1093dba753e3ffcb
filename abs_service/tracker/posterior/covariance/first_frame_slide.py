"""Slide along the surface in the first frame: an error that lasts.

The mesh is made from the first frame, so nothing has moved when its first estimate is found: what that estimate moves
along the surface is an error. It lasts, because the sensors go on disagreeing as they do there: a print with sharp
edges is read from the nearest pixels, and an edge along a row of them is off for all its vertices at once. The
residuals do not show it, they are small. A slide that noise explains is in the covariance already.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.posterior.covariance.tangents import Tangents, along_tangents

#: A slide by noise alone is a vector of two numbers, much the same for all vertices. The square of its length, over
#: half of the mean that is expected, is smaller than this with a probability of 95 % (χ² of two degrees of freedom).
NOT_BY_CHANCE = 5.99


class Slide(Protocol):
    """Covariance of the vertices along the surface, of which the first estimate shows the size."""

    def beyond(self, surface: Surface, known: NDArray[np.float64]) -> NDArray[np.float64]:
        """Covariance (n, 3, 3) [m²] of the vertices of an estimate, besides what is known of them; the first is kept.

        Args:
            surface: the estimate, a population of one.
            known: covariance of the vertices by noise (n, 3, 3) [m²].
        """
        ...


class NoSlide:
    """No slide: a template is laid over the first frame only roughly, and the first estimate corrects it."""

    def beyond(self, surface: Surface, known: NDArray[np.float64]) -> NDArray[np.float64]:
        """Zeros (n, 3, 3)."""
        return np.zeros_like(known)


class FirstFrameSlide:
    """Slide of a mesh that the first frame defines."""

    def __init__(self, mesh: Mesh):
        self._made = mesh.vertices.astype(np.float64)
        self._tangents = Tangents(mesh)
        self._slide = np.zeros((0, 2))

    def beyond(self, surface: Surface, known: NDArray[np.float64]) -> NDArray[np.float64]:
        """Covariance of an error as long as the slide, in its direction, which turns with the surface."""
        if len(self._slide) and not self._slide.any():
            return np.zeros_like(known)
        tangents = self._tangents.along(surface)
        if not len(self._slide):
            slide = np.vecdot(tangents, (surface.vertices[0].T - self._made)[:, None])
            noise = np.trace(tangents @ known @ tangents.transpose(0, 2, 1), axis1=1, axis2=2)
            explained = np.mean(np.vecdot(slide, slide)) < 0.5 * NOT_BY_CHANCE * np.mean(noise)
            self._slide = np.zeros_like(slide) if explained else slide
        return along_tangents(tangents, self._slide)
