"""Surfaces of one frame: cost, derivatives, covariance and agreement of one Θ are asked one after the other."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel, Surface


class FrameSurfaces:
    """The meshes that one frame deforms; each Θ by itself has one surface, in whatever order it is asked for.

    Sensors know a surface that they have seen in this frame again. Nobody asks for a population twice.

    Args:
        model: the deformation model, which does not change within the frame.
    """

    def __init__(self, model: DeformationModel):
        self._model = model
        self._known: dict[bytes, Surface] = {}

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """The mesh deformed with every row of `thetas` (population, dim)."""
        if len(thetas) > 1:
            return self._model.deform(thetas)
        key = thetas.tobytes()
        if key not in self._known:
            self._known[key] = self._model.deform(thetas)
        return self._known[key]
