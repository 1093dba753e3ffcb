"""Misfit of the appearance: where images show material beside its own vertex, the mesh is off by as much.

A sheet of rubber stretches by more than the stretch prior of paper allows. The mesh then keeps its lengths, and colours
disagree: none of its parameters could be off so that this is within its covariance. But the images tell how far each
vertex would have to move along the surface. With the residuals r of its images and their derivatives J with respect to
its position, those of the vertices within two edges included, a step of Lucas and Kanade (IJCAI, 1981) is, along the
surface,

    d = −(A + 1 / L²)⁻¹ b,    A = Σ JᵀJ,    b = Σ Jᵀr,

where L is the distance within which gradients hold. Noise alone makes |d|² as large as (A + 1 / L²)⁻¹ A (A + 1 / L²)⁻¹,
the sum of its diagonal, on average. What |d|² has beyond three deviations of noise is averaged over vertex and
neighbours, and over the mesh, since a part of it may be plain. The larger of the two is added along either tangent,
which is twice as much: colours that do not agree at all are outliers, without which d is too short.

Where images show no displacement, they hold the vertices. A mesh that misses the surface may have moved along it by as
much (`misfit`), with a variance a; but images know its place with the covariance H = (A + 1 / L²)⁻¹. With both, and h
half the sum of H's diagonal, a h / (a + h) is left of it.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh, mean_around, ring_means
from abs_service.tracker.posterior.optimum import Optimum
from abs_service.tracker.terms import chain_rule
from abs_service.tracker.terms.linearization import PointLinearization
from abs_service.tracker.terms.sensor_fit import INLIER_DEVIATIONS
from calib.jit import kernel

#: Distance within which gradients hold, in typical distances between neighbouring vertices.
REACH = 2.0


class SurfaceDisplacement(Protocol):
    """Displacement of the vertices along the surface that images show."""

    def variance(self, optimum: Optimum, possible: NDArray[np.float64]) -> NDArray[np.float64]:
        """Variance (n,) [m²] of the vertices of an estimate, in either direction along the surface.

        Args:
            optimum: the estimate.
            possible: variance (n,) [m²] that images may exclude.
        """
        ...


class NoDisplacement:
    """No displacement: the rig has no images of the appearance."""

    def variance(self, optimum: Optimum, possible: NDArray[np.float64]) -> NDArray[np.float64]:
        """The possible variance (n,): nothing excludes any of it."""
        return possible


class AppearanceMisfit:
    """Displacement by images of the appearance; see the module."""

    def __init__(self, mesh: Mesh):
        self._mean = mean_around(mesh)
        self._around = self._mean @ self._mean  # within two edges
        self._minimum_precision = len(mesh.vertices) / (mesh.area * REACH**2)

    def variance(self, optimum: Optimum, possible: NDArray[np.float64]) -> NDArray[np.float64]:
        """The rest of the possible variance (n,) [m²] and that shown; samples between the vertices show none."""
        vertices, n = optimum.linearized.sparse_jacobian, optimum.surface.vertices.shape[2]
        squares, gradient = np.zeros((n, 3, 3)), np.zeros((n, 3, 1))
        for part in optimum.sensed:
            if isinstance(part, PointLinearization) and part.sparse_jacobian is vertices:
                chain_rule.sum_squares(part.rows, part.points, np.ones(len(part.points)), squares)
                chain_rule.sum_at_points(part.rows, part.points, part.residual[:, None], gradient)
        (excess, held), around = np.empty((2, n)), (self._around.indptr, self._around.indices)
        normals = optimum.surface.normals[0]
        beyond_noise(*around, squares, gradient, normals, self._minimum_precision, excess, held)
        np.maximum(excess, 0.0, out=excess)
        return possible * held / (possible + held) + np.maximum(ring_means(self._mean, excess), excess.mean())


@kernel
def beyond_noise(
    start: NDArray[np.int32],
    around: NDArray[np.int32],
    squares: NDArray[np.float64],
    gradient: NDArray[np.float64],
    normals: NDArray[np.float32],
    minimum_precision: float,
    excess: NDArray[np.float64],
    held: NDArray[np.float64],
) -> None:
    """|d|² beyond `INLIER_DEVIATIONS` of noise (n,) [m²], into `excess`, negative where there is none; h into `held`.

    Args:
        start, around: first place (n + 1,) of every vertex in the list of those around it, itself included (k,).
        squares, gradient: JᵀJ (n, 3, 3) [1/m²] and Jᵀr (n, 3, 1) [1/m] of every vertex.
        normals: of the surface (3, n).
        minimum_precision: 1 / L² [1/m²].
        excess, held: results (n,) [m²].
    """
    for v in range(excess.size):
        x, y, z = np.float64(normals[0, v]), np.float64(normals[1, v]), np.float64(normals[2, v])
        if abs(z) > 0.5:  # normal × (0, 1, 0), or × (0, 0, 1) of one that lies across
            scale = 1 / np.sqrt(x * x + z * z)
            tx, ty, tz = -z * scale, 0.0, x * scale
        else:
            scale = 1 / max(np.sqrt(x * x + y * y), 1e-12)
            tx, ty, tz = y * scale, -x * scale, 0.0
        ux, uy, uz = y * tz - z * ty, z * tx - x * tz, x * ty - y * tx
        a, b, c, f, g = minimum_precision, 0.0, minimum_precision, 0.0, 0.0
        for k in range(start[v], start[v + 1]):
            square, force = squares[around[k]], gradient[around[k]]
            px = square[0, 0] * tx + square[0, 1] * ty + square[0, 2] * tz
            py = square[1, 0] * tx + square[1, 1] * ty + square[1, 2] * tz
            pz = square[2, 0] * tx + square[2, 1] * ty + square[2, 2] * tz
            a += tx * px + ty * py + tz * pz
            b += ux * px + uy * py + uz * pz
            c += (
                ux * (square[0, 0] * ux + 2 * square[0, 1] * uy + 2 * square[0, 2] * uz)
                + uy * (square[1, 1] * uy + 2 * square[1, 2] * uz)
                + uz * square[2, 2] * uz
            )
            f += tx * force[0, 0] + ty * force[1, 0] + tz * force[2, 0]
            g += ux * force[0, 0] + uy * force[1, 0] + uz * force[2, 0]
        determinant = a * c - b * b
        held[v] = 0.5 * (a + c) / determinant
        one, other = c * f - b * g, a * g - b * f
        # With G = (A + 1 / L²)⁻¹, the trace of G A G is that of G − G² / L².
        noise = (a + c) / determinant - minimum_precision * (a * a + 2 * b * b + c * c) / determinant**2
        excess[v] = (one * one + other * other) / determinant**2 - INLIER_DEVIATIONS**2 * noise
