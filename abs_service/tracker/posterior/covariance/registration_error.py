"""Covariance of Θ by the registration of a template: it is laid over the first image as a rigid body."""

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models.base import DeformationModel


def registration_covariance(model: DeformationModel, deviation: float) -> NDArray[np.float64]:
    """Covariance (dim, dim) of errors that displace and turn the mesh at rest as a whole.

    Args:
        model: the deformation model; changes of theta follow the displacements as well as they can.
        deviation: standard deviation of a displacement along each axis, and of what a turn about each does to a vertex
            at the radius of gyration [m].
    """
    arms = model.mesh.vertices - model.mesh.vertices.mean(axis=0)
    radius = max(float(np.sqrt(np.mean(np.sum(arms**2, axis=1)))), np.finfo(float).eps)
    shifts = np.broadcast_to(np.eye(3), (len(arms), 3, 3))
    turns = np.cross(np.eye(3)[None], arms[:, None] / radius).transpose(0, 2, 1)
    moves = np.concatenate([shifts, turns], axis=2).reshape(-1, 6)
    changes = np.asarray(
        np.linalg.lstsq(model.sparse_jacobian(model.rest).dense.reshape(len(moves), -1), moves)[0], np.float64
    )
    return deviation**2 * changes @ changes.T
