"""Rigid motion: the simplest model, with six parameters."""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import BOARD, SparseJacobian, Surface
from abs_service.tracker.models.parts.noiseless_normals import noiseless_normals
from calib import pose


@dataclass(frozen=True)
class Settings:
    """A rigid model has no keys."""

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board from which the model can be built: any."""
        return BOARD

    def build(self, detection: InitialDetection) -> "Rigid":
        """The rigid model of an object of any shape.

        Raises:
            DetectionError: the object is too small.
        """
        return self.of_mesh(grid_mesh(detection))

    def of_mesh(self, mesh: Mesh) -> "Rigid":
        """The rigid model of any mesh."""
        return Rigid(mesh)


class Rigid:
    """Θ = rotation vector [rad] about the mesh's centroid, translation [m].

    Attributes:
        mesh: the mesh.
        rest: zeros (6,).
        scales: (6,): the rotation [rad] that moves the farthest vertex by one metre, and one metre.
        roughness, prior: none (0, 6).
    """

    def __init__(self, mesh: Mesh):
        self.mesh = mesh
        self.rest = np.zeros(6)
        self._centroid = mesh.vertices.mean(axis=0)
        self._arms = mesh.vertices - self._centroid
        self._arms_32 = np.ascontiguousarray(self._arms.T, np.float32)
        self._normals_32 = np.ascontiguousarray(noiseless_normals(mesh).T, np.float32)
        radius = np.linalg.norm(self._arms, axis=1).max()
        self.scales = np.repeat([1 / max(radius, 1e-3), 1.0], 3)
        self.roughness = self.prior = np.zeros((0, 6))

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Moves the mesh with every row of `thetas` (population, 6)."""
        rotations = scipy.spatial.transform.Rotation.from_rotvec(thetas[:, :3]).as_matrix()
        turns, shape = rotations.reshape(-1, 3).astype(np.float32), (len(thetas), 3, -1)
        vertices, normals = (turns @ part for part in (self._arms_32, self._normals_32))
        vertices += (self._centroid + thetas[:, 3:]).reshape(-1, 1).astype(np.float32)
        return Surface(vertices.reshape(shape), normals.reshape(shape))

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Jacobian of the vertices with respect to theta, at theta (6,): one group."""
        turned = pose.transform(pose.from_rotation_vector(theta[:3], (0, 0, 0)), self._arms)
        shifts = np.broadcast_to(np.eye(3), (len(turned), 3, 3))
        turns = pose.rotated_points_jacobian(theta[:3], turned)
        return SparseJacobian.from_dense(np.concatenate([turns, shifts], axis=2))
