"""Interface of deformation models, and the surfaces and Jacobians that they compute."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh

#: Width and height [m] of a flat board, for models that can be built from a board of any size.
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


class JacobianBlocks(NamedTuple):
    """The arrays of a `SparseJacobian`, as kernels take them."""

    group: NDArray[np.int32]
    parameters: NDArray[np.int64]
    local: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SparseJacobian:
    """Jacobian of points with respect to theta, without the columns that are zero for a whole group of points.

    Attributes:
        local: derivatives (n, 3, k) of each point with respect to the k parameters of its group, contiguous.
        group: index (n,) of each point's group.
        parameters: indices (groups, k) of the parameters on which each group depends.
        dimension: number of all parameters, dim.
    """

    local: NDArray[np.float64]
    group: NDArray[np.int32]
    parameters: NDArray[np.int64]
    dimension: int

    @classmethod
    def from_dense(cls, jacobian: NDArray[np.float64]) -> "SparseJacobian":
        """One group of all points, from a dense Jacobian (n, 3, dim)."""
        n, _, dimension = jacobian.shape
        return cls(np.ascontiguousarray(jacobian), np.zeros(n, np.int32), np.arange(dimension)[None], dimension)

    @property
    def blocks(self) -> JacobianBlocks:
        """The arguments of kernels."""
        return JacobianBlocks(self.group, self.parameters, self.local)

    @property
    def dense(self) -> NDArray[np.float64]:
        """The same as a dense array (n, 3, dim)."""
        result = np.zeros((len(self.local), 3, self.dimension))
        np.put_along_axis(result, self.parameters[self.group][:, None], self.local, axis=2)
        return result


class ModelError(ValueError):
    """A model cannot be built from these settings and this mesh."""


@runtime_checkable
class HasDerived(Protocol):
    """A part with numbers that follow from sensor and first image unless its keys give them."""

    @property
    def derived(self) -> Mapping[str, tuple[float, ...]]:
        """Derived numbers by key, as they are in use."""
        ...


@runtime_checkable
class HasOffsets(Protocol):
    """Settings of a model whose vertices have offsets, which can be learnt (`vertex_offsets` of a tracker)."""

    @property
    def has_offsets(self) -> Literal[True]:
        """True."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class VertexBasis:
    """Vertices as a function of theta, for a surface whose points are linear in it.

    With the control points p of theta, a vertex is Σ value p + offset · n, with the unit normal n of the tangents
    Σ along_u p and Σ along_w p (eqs. 2 and 8).

    Attributes:
        control_points: numbers (n, k) of the control points that each vertex depends on.
        value, along_u, along_w: (n, k).
    """

    control_points: NDArray[np.int32]
    value: NDArray[np.float32]
    along_u: NDArray[np.float32]
    along_w: NDArray[np.float32]


@runtime_checkable
class HasVertexBasis(Protocol):
    """A model whose vertices follow from theta by a basis, so that other programs can compute them."""

    @property
    def vertex_basis(self) -> VertexBasis:
        """The basis; the same for the life of the model."""
        ...

    @property
    def offset(self) -> NDArray[np.float32]:
        """Offsets of the vertices along their normals (n,) [m], as they are known now."""
        ...


class DeformationModel(Protocol):
    """A deformation `D_Θ` of a mesh (eq. 1).

    Attributes:
        mesh: the mesh it deforms, vertices in the order of `deform`'s output.
        rest: parameters Θ⁰ (dim,) that leave the mesh undeformed.
        scales: change (dim,) of each parameter that moves the surface by about one metre.
        roughness: its product (k,) with a change of theta tells how unsmooth the change is, in the unit of a
            displacement [m]; k is 0 if every change is smooth.
        prior: square root (k, dim) of the precision matrix of a Gaussian prior: its product with Θ − Θ⁰ is standard
            normal; k is 0 without a prior.
    """

    mesh: Mesh
    rest: NDArray[np.float64]
    scales: NDArray[np.float64]
    roughness: NDArray[np.float64]
    prior: NDArray[np.float64]

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh with every row of `thetas` (population, dim)."""
        ...

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Jacobian of the vertices with respect to theta, at theta (dim,)."""
        ...
