"""Interface of the outline of an object in one camera, and the null object without one."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.synthesis.window import WHOLE
from abs_service.tracker.terms.depth.classification.visibility import Visibility
from abs_service.tracker.terms.linearization import Linearization, PointLinearization
from abs_service.tracker.terms.sensor_fit import RimFit


class ObservedOutline(Protocol):
    """Cost of the outline in one frame of one camera."""

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Pixels of the window (rows, columns) near the outline that are held against no vertex."""
        ...

    def cost(self, surface: Surface) -> NDArray[np.float64] | float:
        """Cost (population,) of every deformed mesh."""
        ...

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """Normalised residuals of a population of one and their derivatives with respect to theta."""
        ...

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian) -> PointLinearization:
        """Residuals of the places of vertices where the outline is looked for beside the mesh, see `ObservedTerm`."""
        ...

    def fit(self, surface: Surface) -> RimFit:
        """Agreement of the free edges of a population of one with the outline."""
        ...


class Outline(Protocol):
    """The outline of an object in one camera, frame after frame."""

    def observe(
        self,
        distance: NDArray[np.float32],
        seen: Visibility,
        expected: NDArray[np.float32],
        predicted: Surface,
        window: Window = WHOLE,
    ) -> ObservedOutline:
        """The cost of the outline in a window of a depth image.

        Args:
            distance: measured distances (rows, columns) [m] in the window.
            seen: their classification.
            expected: distances of the predicted surface there, infinite beside it [m].
            predicted: predicted surface, a population of one.
            window: of the image.
        """
        ...


class NoOutline:
    """Null object for objects whose outline is not compared."""

    def observe(
        self,
        distance: NDArray[np.float32],
        seen: Visibility,
        expected: NDArray[np.float32],
        predicted: Surface,
        window: Window = WHOLE,
    ) -> "UnobservedOutline":
        """Outline without any edge: there is nothing to compare."""
        return UnobservedOutline(np.zeros(distance.shape, np.bool_))


@dataclass(frozen=True, slots=True, eq=False)
class UnobservedOutline:
    """Null object: zero cost.

    Attributes:
        doubtful: no pixel of the window (rows, columns).
    """

    doubtful: NDArray[np.bool_]

    def cost(self, surface: Surface) -> float:
        """Zero."""
        return 0.0

    def linearize(self, surface: Surface, sparse_jacobian: SparseJacobian) -> Linearization:
        """No rows."""
        return Linearization(np.zeros(0), np.zeros((0, sparse_jacobian.dimension)))

    def match(self, surface: Surface, sparse_jacobian: SparseJacobian) -> PointLinearization:
        """No residuals."""
        return PointLinearization.empty(sparse_jacobian)

    def fit(self, surface: Surface) -> RimFit:
        """No free edges."""
        return RimFit()
