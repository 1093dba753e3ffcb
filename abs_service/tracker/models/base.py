"""What a deformation model is."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh

#: Width and height [m] of a flat board, for models that any board would do for.
BOARD = (0.3, 0.2)


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A population of deformed meshes as structure of arrays.

    Attributes:
        vertices: positions (population, 3, n) [m] in rig coordinates, float32.
        normals: unit normals of the same shape, pointing to the side that faces the sensors at rest.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]


class ModelError(ValueError):
    """A model that cannot be made from these settings and this mesh."""


class DeformationModel(Protocol):
    """A deformation `D_Θ` of a mesh (eq. 1).

    Attributes:
        mesh: the mesh it deforms, vertices in the order of `deform`'s output.
        rest: parameters Θ⁰ (dim,) that leave the mesh undeformed.
        scales: size (dim,) of each parameter that moves the surface by about one metre.
        prior: what is known of Θ before any measurement: a matrix (k, dim) whose product with Θ − Θ⁰ is standard
            normal; k is 0 where nothing is known.
    """

    mesh: Mesh
    rest: NDArray[np.float64]
    scales: NDArray[np.float64]
    prior: NDArray[np.float64]

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh with every row of `thetas` (population, dim)."""
        ...

    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives (n, 3, dim) of the vertices by the parameters at theta (dim,), contiguous."""
        ...
