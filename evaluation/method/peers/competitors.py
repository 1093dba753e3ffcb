"""Other programs that deform a template to measured points; each may be missing."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.grid_mesh import triangles
from calib import pose
from evaluation.scenes.bent_sheet import SIDE, SheetFrame

#: Coherent point drift is tuned for points that are about one apart: it gets them in units of 100 mm.
UNIT_M = 0.1

ALPHA, BETA, ITERATIONS = 1.0, 1.0, 50

#: Points farther apart do not correspond, in the same units; the plain Gauss–Newton fit has the same bound.
GATE = 1.0


#: Moves its second argument (n, 3) to its first (k, 3), both in units, with a package.
Registration = Callable[[Any, NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]


class SheetTracker(Protocol):
    """Tracks a template through frames, starting each from the result of the last."""

    def track(self, frame: SheetFrame) -> NDArray[np.floating]:
        """Vertices (n, 3) [m] of the template in a frame."""
        ...


class PointSets:
    """A registration of point sets, begun at the last frame's result.

    Args:
        vertices: the template (n, 3) [m] in its first pose.
        package: what `register` needs.
        register: see `Registration`.
    """

    def __init__(self, vertices: NDArray[np.float64], package: str, register: Registration):
        self._vertices = vertices
        self._module = import_module(package)
        self._register = register

    def track(self, frame: SheetFrame) -> NDArray[np.float64]:
        """Vertices (n, 3) [m] in a frame."""
        moved = self._register(self._module, frame.cloud / UNIT_M, self._vertices / UNIT_M)
        self._vertices = np.asarray(moved, np.float64) * UNIT_M
        return self._vertices


class NoTracking:
    """Baseline without tracking: the first pose in every frame."""

    def __init__(self, vertices: NDArray[np.float64]):
        self._vertices = vertices

    def track(self, frame: SheetFrame) -> NDArray[np.float64]:
        """The template's first pose."""
        return self._vertices


def _pycpd(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    drift = module.DeformableRegistration(alpha=ALPHA, beta=BETA, X=cloud, Y=source, max_iterations=ITERATIONS)
    return drift.register()[0]


def _biocpd(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    drift = module.DeformableRegistration(
        alpha=ALPHA, beta=BETA, X=cloud, Y=source, max_iterations=ITERATIONS, num_eig=60
    )
    return drift.register()[0]


def _rustcpd_full(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    return module.register_deformable(
        cloud, source, alpha=ALPHA, beta=BETA, low_rank=None, max_iterations=ITERATIONS, parallel=False
    ).points


def _rustcpd_fast(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    return module.register_deformable(
        cloud,
        source,
        alpha=ALPHA,
        beta=BETA,
        low_rank=60,
        k=10,
        max_iterations=20,
        parallel=False,
        single_precision=True,
    ).points


def _amberg(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    return module.nricp_amberg(_mesh(source), cloud, use_faces=False)


def _sumner(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    return module.nricp_sumner(_mesh(source), cloud, use_faces=False)


def _mesh(vertices: NDArray[np.float64]) -> Any:
    faces = triangles(np.arange(SIDE * SIDE).reshape(SIDE, SIDE))
    return import_module("trimesh").Trimesh(vertices, faces, process=False)


def _open3d_icp(module: Any, cloud: NDArray[np.float64], source: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rigid: all that Open3D's registrations are."""
    points, registration = module.geometry.PointCloud, module.pipelines.registration
    vectors = module.utility.Vector3dVector
    found = registration.registration_icp(
        points(vectors(source)),
        points(vectors(cloud)),
        GATE,
        np.eye(4),
        registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(max_iteration=ITERATIONS),
    )
    return pose.transform(found.transformation, source)


#: What a row is called, the package that it needs, and its registration.
KNOWN: Mapping[str, tuple[str, Registration]] = {
    "pycpd": ("pycpd", _pycpd),
    "biocpd, rank 60": ("biocpd", _biocpd),
    "rustcpd, full rank": ("rustcpd", _rustcpd_full),
    "rustcpd, rank 60, k 10, f32": ("rustcpd", _rustcpd_fast),
    "trimesh nricp_amberg": ("trimesh.registration", _amberg),
    "trimesh nricp_sumner": ("trimesh.registration", _sumner),
    "Open3D, rigid ICP": ("open3d", _open3d_icp),
}


def installed(names: Sequence[str]) -> dict[str, Callable[[NDArray[np.float64]], SheetTracker]]:
    """Makers of those of the named competitors whose packages are installed."""
    return {
        name: partial(PointSets, package=package, register=register)
        for name, (package, register) in KNOWN.items()
        if name in names and _imports(package)
    }


def _imports(package: str) -> bool:
    """True if a package can be used: Open3D may be installed and lack a library of the system."""
    try:
        import_module(package)
    except ImportError:
        return False
    return True
