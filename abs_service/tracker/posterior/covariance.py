"""Covariance of Θ and of every vertex.

**Θ.** At the optimum, JᵀJ + P is the curvature of the cost, with the Jacobian J of the sensors' normalised residuals r
and the curvature P of the priors. Σ = (JᵀJ + P)⁻¹ is the covariance if the noise models are exact. They are not: a
colour is read at the nearest pixel, which adds about (slope · pixel)² / 12 (uniform quantisation) to its variance on
sharp print, and on smooth print a cautious model overestimates σ. The sandwich Σ (Jᵀ diag(r² / (1 − h)) J + P) Σ uses
the squared residuals instead (White, Econometrica 50, 1982). The leverage h = diag(J Σ Jᵀ) is the share of its own
noise that each residual loses to the fit (HC2 of MacKinnon and White, J. Econometrics 29, 1985): if the noise models
are exact, r² / (1 − h) is 1 on average and the sandwich equals Σ.

**Vertices.** The noise of the first frame displaces every vertex by σε along its normal n, with ε standard normal; the
vertex keeps what of this offset is not learnt over the frames (`tracking.offsets`). The sensors measure the
surface, not the vertex. The search therefore corrects the part of the offsets that Θ can represent, and only the rest
remains. With the derivatives D of the vertices, the offsets E = σn, and the derivatives JE of the residuals with
respect to ε, the response of Θ is −Σ JᵀJE ε, and the error of a vertex is (E − D Σ JᵀJE) ε besides D times the error of
Θ. Where the sensors outweigh the priors, D Σ JᵀJ is the projection Π onto the range of D, and σ²(I − Π) remains. This
variance hardly changes with the frames. It is computed once per mesh, in the second frame; its component along the
normal is added to the covariance of the vertices.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import SparseJacobian, Surface
from abs_service.tracker.posterior.curvature import solved, whitened
from abs_service.tracker.terms.linearization import Part
from calib.jit import kernel

#: Share of the widest motion prior's precision that keeps `unheld_deviation` finite, and number of vertices it probes.
KEPT_PRIOR, PROBES = 1e-3, 24

#: Lower bound of 1 − h; below it, rounding errors dominate.
LEAST_KEPT = 1e-6


#: Residuals and derivatives of the sensors, by source, in parts; and a value of each residual (m,).
Sensed = Sequence[Sequence[Part]]
PerResidual = Sequence[Sequence[NDArray[np.float64]]]


def leverages(inverse: NDArray[np.float64], sensed: Sensed) -> PerResidual:
    """Leverage h = diag(J Σ Jᵀ) of every residual, from Σ (dim, dim)."""
    return [[part.leverage(inverse) for part in parts] for parts in sensed]


def score_covariance(
    priors: NDArray[np.float64], sensed: Sensed, leverage: PerResidual, effects: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance (dim, dim) of the gradient: B = Jᵀ diag(D r² / (1 − h)) J + P.

    The covariance of Θ is the sandwich Σ B Σ.

    Args:
        priors: P (dim, dim).
        sensed: r and J of the sensors.
        leverage: h.
        effects: design effect D (sources,) of the residuals of every source, see `correlation`.
    """
    result = priors.copy()
    for parts, shares, effect in zip(sensed, leverage, effects):
        for part, share in zip(parts, shares):
            part.add_square(part.residual**2 * (effect / np.maximum(1 - share, LEAST_KEPT)), result)
    return result


def shared_covariance(sensed: Sensed, dimension: int) -> NDArray[np.float64]:
    """Covariance (dim, dim) of the gradient of errors that many residuals share, the same in all frames."""
    result = np.zeros((dimension, dimension))
    for part in (part for parts in sensed for part in parts if len(part.shared)):
        result += part.shared.T @ part.shared
    return result


def propagated(sparse_jacobian: SparseJacobian, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance D Σ Dᵀ (n, 3, 3) of every vertex, from its Jacobian D and the covariance Σ (dim, dim) of Θ."""
    result = np.empty((len(sparse_jacobian.local), 3, 3))
    of_points = sparse_jacobian.local, sparse_jacobian.group, sparse_jacobian.parameters
    _propagate(*of_points, np.ascontiguousarray(covariance), result)
    return result


@kernel
def _propagate(
    local: NDArray[np.float64],
    group: NDArray[np.int32],
    parameters: NDArray[np.int64],
    covariance: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """See `propagated`; points of a group that follow each other share one product of matrices."""
    n, _, k = local.shape
    part, first = np.empty((k, k)), 0
    while first < n:
        own, last = parameters[group[first]], first + 1
        while last < n and group[last] == group[first]:
            last += 1
        for i in range(k):
            line = covariance[own[i]]
            for j in range(k):
                part[i, j] = line[own[j]]
        rows = local[first:last].reshape((3 * (last - first), k))
        products = np.dot(rows, part)
        for v in range(last - first):
            square = result[first + v]
            for i in range(3):
                for j in range(i, 3):
                    total = 0.0
                    for d in range(k):
                        total += products[3 * v + i, d] * rows[3 * v + j, d]
                    square[i, j] = square[j, i] = total
        first = last


def unheld_deviation(
    curvature: NDArray[np.float64],
    least_precision: NDArray[np.float64],
    sparse_jacobian: SparseJacobian,
) -> float:
    """Standard deviation [m] of a vertex by the measurements of one frame alone, median: large if nothing holds it.

    Args:
        curvature: (dim, dim), of likelihood and priors without the motion prior.
        least_precision: of the widest motion prior (dim, dim), of which hardly anything is kept.
        sparse_jacobian: derivative of the vertices.
    """
    alone = curvature + KEPT_PRIOR * least_precision
    some = np.linspace(0, len(sparse_jacobian.local) - 1, PROBES).astype(np.intp)
    rows = np.zeros((PROBES, 3, len(alone)))
    np.put_along_axis(
        rows, sparse_jacobian.parameters[sparse_jacobian.group[some]][:, None], sparse_jacobian.local[some], axis=2
    )
    white = whitened(alone, rows.reshape(-1, len(alone)).T)
    return float(np.sqrt(np.median(np.sum(white**2, axis=0).reshape(PROBES, 3).sum(axis=1))))


def unseen_motion(
    motion: NDArray[np.float64],
    curvature: NDArray[np.float64],
    least_precision: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The part (dim, dim) of a motion's covariance (dim, dim) that the measurements of a frame do not show.

    With the widest motion prior, the gain G tells how much of a motion the estimate lacks: next to nothing where
    something is measured, everything where nothing is. G⁸ tells the two apart. With a narrow prior, a single frame
    shows little of any motion, and several frames show it.

    Args:
        motion: covariance of the motion between two frames.
        curvature: (dim, dim), of likelihood and priors without the motion prior.
        least_precision: of the widest motion prior (dim, dim).
    """
    # Single precision is enough for a share that only tells the two apart, and takes half the time.
    unseen = solved(curvature + least_precision, least_precision).astype(np.float32)
    for _ in range(3):
        unseen = unseen @ unseen
    return np.asarray(unseen @ motion.astype(np.float32) @ unseen.T, np.float64)


def along_normals(surface: Surface, variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (n, 3, 3) [m²] of errors along the normals of a population of one with a variance (n,) [m²]."""
    normals = surface.normals[0].T.astype(np.float64)
    return variance[:, None, None] * normals[:, :, None] * normals[:, None, :]


def isotropic(variance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (n, 3, 3) [m²] of errors with a variance (n,) [m²] in every direction."""
    return variance[:, None, None] * np.eye(3)


def uncorrected_variance(
    normals: NDArray[np.float64],
    deviation: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    response: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Variance (n,) [m²] along the normals of the part of the mesh's own errors that Θ does not correct.

    Args:
        normals: unit normals (n, 3).
        deviation: σ of the vertices along them (n,) [m].
        jacobian: D, derivatives (n, 3, dim) of the vertices.
        response: −Σ JᵀJE, the change (dim, n) of Θ that each vertex's error causes.
    """
    left = np.einsum("ni,nid->nd", normals, jacobian) @ response
    left.flat[:: len(left) + 1] += deviation
    return np.einsum("nk,nk->n", left, left)
