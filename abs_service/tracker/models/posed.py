"""A rigid pose combined with another deformation model: the object moves as a whole and deforms."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import DeformationModel, HasDerived, SparseJacobian, Surface
from calib import pose
from calib.jit import kernel, prange

#: Prior standard deviation of the rigid motion within the shape's own parameters [m].
GAUGE_M = 1e-4

#: A shape contains a rigid motion if the cosine between the motion and the span of the shape's Jacobian is larger.
CONTAINED = 0.999


@dataclass(frozen=True)
class Settings:
    """TOML keys of the model.

    Attributes:
        shape: another model, a table with its `type` and keys.
    """

    shape: Any = field(metadata={"parts": "abs_service.tracker.models"})

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board from which the shape can be built."""
        return self.shape.board

    def build(self, detection: InitialDetection) -> "Posed":
        """The model of an object: its shape with a pose.

        Raises:
            ModelError, DetectionError: the shape cannot be built.
        """
        return Posed(self.shape.build(detection))

    def of_mesh(self, mesh: Mesh) -> "Posed":
        """The model of a mesh: its shape with a pose.

        Raises:
            ModelError: the shape cannot be bound to it.
        """
        return Posed(self.shape.of_mesh(mesh))


class Posed:
    """Θ = rotation vector [rad] about the centroid of the mesh at rest, translation [m], then the shape's parameters.

    The shape deforms first. If it can move rigidly by itself (all control points of a NURBS together), one surface has
    many Θ. The prior fixes this gauge freedom: to first order, the rigid part of the shape's motion (least squares over
    the vertices) is Gaussian with zero mean and a deviation of `GAUGE_M`. It contradicts no measurement, so the pose
    parameters are the pose of the object, and the shape parameters its deformation.

    Attributes:
        mesh: the shape's mesh.
        rest: no motion, the shape at rest.
        scales: the rotation [rad] that moves the farthest vertex by one metre, one metre, the shape's own.
        roughness: the shape's own.
        prior: the shape's own, then one row per rigid motion that the shape contains.
        derived: numbers of the shape that follow from the first image, by their keys; empty if it has none.
    """

    def __init__(self, shape: DeformationModel):
        self.mesh = shape.mesh
        known = shape.derived if isinstance(shape, HasDerived) else {}
        self.derived = {f"shape.{key}": numbers for key, numbers in known.items()}
        self._shape = shape
        self._centroid = shape.mesh.vertices.mean(axis=0)
        radius = max(np.linalg.norm(shape.mesh.vertices - self._centroid, axis=1).max(), 1e-3)
        self.rest = np.concatenate([np.zeros(6), shape.rest])
        self.scales = np.concatenate([np.full(3, 1 / radius), np.ones(3), shape.scales])
        self.roughness = np.pad(shape.roughness, ((0, 0), (6, 0)))
        self.prior = np.pad(np.concatenate([shape.prior, _gauge(shape)]), ((0, 0), (6, 0)))

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh with every row of `thetas` (population, dim)."""
        surface = self._shape.deform(thetas[:, 6:])
        rotations = scipy.spatial.transform.Rotation.from_rotvec(thetas[:, :3]).as_matrix()
        shifts = self._centroid + thetas[:, 3:6]
        motion = np.concatenate([rotations, shifts[:, :, None]], axis=2).astype(np.float32)
        _move(motion, self._centroid.astype(np.float32), surface.vertices, surface.normals)
        return surface

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Jacobian in the shape's groups: a vertex depends on the pose and on the shape parameters of its group."""
        R = pose.from_rotation_vector(theta[:3], (0, 0, 0))[:3, :3]
        turned = (self._shape.deform(theta[None, 6:]).vertices[0].T - self._centroid) @ R.T
        shape = self._shape.sparse_jacobian(theta[6:])
        local = np.empty((len(turned), 3, 6 + shape.local.shape[2]))
        local[:, :, :3] = pose.rotated_points_jacobian(theta[:3], turned)
        local[:, :, 3:6] = np.eye(3)
        np.matmul(R, shape.local, out=local[:, :, 6:])
        posing = np.broadcast_to(np.arange(6), (len(shape.parameters), 6))
        return SparseJacobian(local, shape.group, np.concatenate([posing, shape.parameters + 6], axis=1), len(theta))


def _gauge(shape: DeformationModel) -> NDArray[np.float64]:
    """Rows (k, dim of the shape) of the prior, one for each of k ≤ 6 rigid motions that the shape contains."""
    count = len(shape.mesh.vertices)
    # Columns: the scaled Jacobian, the displacement of all vertex components when a parameter changes by its scale.
    motions = shape.sparse_jacobian(shape.rest).dense.transpose(1, 0, 2).reshape(3 * count, -1) * shape.scales
    arms = shape.mesh.vertices - shape.mesh.vertices.mean(axis=0)
    turns = [np.cross(axis, arms).T.ravel() for axis in np.eye(3)]
    rigid = np.linalg.qr(np.column_stack([np.kron(np.eye(3), np.ones((count, 1))), *turns]))[0]
    left, sizes, _ = np.linalg.svd(motions, full_matrices=False)
    mixes, cosines, _ = np.linalg.svd(rigid.T @ left[:, sizes > 1e-3 * sizes[0]])
    contained = rigid @ mixes[:, : len(cosines)][:, cosines > CONTAINED]
    return contained.T @ (motions / shape.scales) / (np.sqrt(count) * GAUGE_M)


@kernel
def _move(
    motion: NDArray[np.float32],
    center: NDArray[np.float32],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Transforms vertices and normals (population, 3, n) by `motion` (…, 3, 4) about `center` (3,), in place."""
    n = vertices.shape[2]
    for k in prange(vertices.shape[0]):
        old = np.empty((2, 3, n), np.float32)
        old[0], old[1] = vertices[k], normals[k]
        for i in range(3):
            r0, r1, r2 = motion[k, i, 0], motion[k, i, 1], motion[k, i, 2]
            shift = motion[k, i, 3]
            for v in range(n):
                vertices[k, i, v] = (
                    r0 * (old[0, 0, v] - center[0])
                    + r1 * (old[0, 1, v] - center[1])
                    + r2 * (old[0, 2, v] - center[2])
                    + shift
                )
            for v in range(n):
                normals[k, i, v] = r0 * old[1, 0, v] + r1 * old[1, 1, v] + r2 * old[1, 2, v]
