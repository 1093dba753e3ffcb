"""An estimate as arrays, with the triangles of its mesh."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.estimates import estimate as tracker_estimate
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Estimate:
    """Deformation at one moment, with the mesh that is deformed.

    Attributes:
        time_s: the moment [s], on the clock of the images.
        status: INITIALIZING until an object is found, TRACKING, DEGRADED or LOST.
        reasons: why it is not TRACKING.
        theta: parameters (dim,) of the deformation model, SI units; empty while INITIALIZING.
        covariance: of theta (dim, dim); NaN while LOST.
        vertices: deformed mesh (n, 3) [m] in the frame of the rig; that of the depth camera unless its pose differs.
        vertex_covariance: of every vertex (n, 3, 3) [m²]; NaN while LOST.
        faces: vertex indices (m, 3) of the triangles.
        undeformed: the mesh at rest (n, 3) [m].
        mesh_version: counts the meshes; theta and vertices are comparable between estimates of one version.
        inlier_share: share of the vertices facing a depth sensor that agree with their measurement, 0…1.
        residuals: normalised residual of every sensor: standard deviation of measured minus synthesised values, divided
            by the σ of its noise model; near 1 if the noise model is right, NaN if nothing was measured.
        evaluations: how often the cost of a candidate was computed.
        missing: sensors that did not contribute.
        warnings: doubts about the object that was detected, whatever the status.
    """

    time_s: float
    status: Status
    reasons: tuple[str, ...]
    theta: NDArray[np.float64]
    covariance: NDArray[np.float64]
    vertices: NDArray[np.float32]
    vertex_covariance: NDArray[np.float64]
    faces: NDArray[np.int32]
    undeformed: NDArray[np.float64]
    mesh_version: int
    inlier_share: float
    residuals: Mapping[str, float]
    evaluations: int
    missing: tuple[str, ...]
    warnings: tuple[str, ...]


def with_mesh(found: tracker_estimate.Estimate, mesh: Mesh | None, version: int) -> Estimate:
    """The estimate of a tracker with its mesh; None before the first object was found."""
    is_lost = found.status == Status.LOST
    return Estimate(
        time_s=found.t_host_ns * 1e-9,
        status=found.status,
        reasons=found.reasons,
        theta=found.theta,
        covariance=_nan_if(is_lost, found.covariance),
        vertices=found.vertices,
        vertex_covariance=_nan_if(is_lost, found.vertex_covariance),
        faces=np.zeros((0, 3), np.int32) if mesh is None else _read_only(mesh.faces),
        undeformed=np.zeros((0, 3)) if mesh is None else _read_only(mesh.vertices),
        mesh_version=version,
        inlier_share=found.inlier_share,
        residuals={fit.sensor: fit.normalized_residual for fit in found.fits},
        evaluations=found.search.evaluations,
        missing=found.missing,
        warnings=found.warnings,
    )


def _nan_if(is_unknown: bool, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.full_like(covariance, np.nan) if is_unknown else covariance


def _read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A read-only view: the tracker keeps using the array."""
    view = array.view()
    view.setflags(write=False)
    return view
