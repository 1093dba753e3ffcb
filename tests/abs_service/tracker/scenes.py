"""Meshes, cameras and images that the tests of the tracker look at."""

from collections.abc import Callable

import numpy as np

from abs_service.pairing.images import DepthImage, Image
from abs_service.pairing.observation import Observation, Source
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from abs_service.tracker.synthesis.base import Synthesis
from abs_service.tracker.synthesis.sparse import Sparse, SparseView
from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from calib.noise.images.color import GaussianColor
from calib.rig import Rig, Sensor

#: A small camera with a lens and a pose of its own; it sees a sheet of 0.3 × 0.2 m at z = 1 m with some room around.
CAMERA = Camera(
    64,
    48,
    150.0,
    152.0,
    31.2,
    23.9,
    Lens(np.array([-0.15, 0.03, 1e-3, -1e-3, 0.005])),
    pose.look_at([0.05, -0.03, 0.02], [0.0, 0.0, 1.0]),
)

#: A fisheye that sees 80° to both sides, where CAMERA is; the sheet fills the same part of its image.
FISHEYE = Camera(64, 48, 28.0, 28.5, 31.2, 23.9, KannalaBrandt(np.array([0.02, -0.01, 4e-3, -1e-3])), CAMERA.T_rs)


def wave(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A gently bent sheet at z = 1 m [m]."""
    return 1.0 + 0.02 * np.sin(9 * x) + 0.5 * y**2


def flat(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The plane z = 1 m."""
    return np.ones_like(x + y)


def sheet(
    rows: int = 9,
    columns: int = 13,
    height: Callable[[np.ndarray, np.ndarray], np.ndarray] = wave,
    size: tuple[float, float] = (0.3, 0.2),
) -> Mesh:
    """A regular mesh over a rectangle of the given width and height [m], seen from the origin."""
    x, y = np.meshgrid(np.linspace(-size[0] / 2, size[0] / 2, columns), np.linspace(-size[1] / 2, size[1] / 2, rows))
    vertices = np.stack([x, y, height(x, y)], axis=-1).reshape(-1, 3)
    place = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    colors = np.random.default_rng(5).uniform(20, 235, (len(vertices), 3)).astype(np.float32)
    chart = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(float)
    return Mesh(vertices, faces, colors, chart)


def as_surface(*meshes: tuple[np.ndarray, np.ndarray]) -> Surface:
    """A population from vertices and normals, each (n, 3)."""
    stacked = [np.ascontiguousarray(np.stack([pair[i].T for pair in meshes]), np.float32) for i in range(2)]
    return Surface(stacked[0], stacked[1])


def sparse(camera: Camera, mesh: Mesh | None = None) -> Sparse:
    """Sparse direct synthesis for two sensors, tof and color, with one camera; of single points without a mesh."""
    faceless = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 3), np.float32), np.zeros((0, 2)))
    rig = Rig("r", {name: Sensor(name, camera, GaussianColor()) for name in ("tof", "color")})
    return Sparse(rig, faceless if mesh is None else mesh)


def seen(camera: Camera, surface: Surface) -> Synthesis:
    """Synthesis of single points in a camera."""
    points = surface.vertices.shape[2]
    view = SparseView(camera, np.zeros((0, 3), np.int32), np.zeros((points, 0), np.float32))
    return view.unoccluded(surface).synthesize(surface)


def in_sight(camera: Camera, count: int) -> Surface:
    """Prediction of vertices before a camera that all face it: it hides nothing."""
    axis = camera.T_rs[:3, 2]
    return as_surface((np.tile(camera.center + axis, (count, 1)), np.tile(-axis, (count, 1))))


def observation(t_ns: int = 0, missing: tuple[str, ...] = (), **images: Image) -> Observation:
    """An observation of images by sensor name."""
    return Observation(0, t_ns, dict(images), {name: Source(0, t_ns) for name in images}, missing)


def depth_image(distance: np.ndarray, amplitude: float = 3000.0) -> DepthImage:
    """Distances with the same amplitude everywhere."""
    return DepthImage(distance.astype(np.float32), np.full(distance.shape, amplitude, np.float32))


def plane_distance(camera: Camera, normal: np.ndarray, offset: float) -> np.ndarray:
    """Radial distances (height, width) [m] of the plane normal · p = offset; NaN where it is behind the camera."""
    rays = camera.rays() @ camera.T_rs[:3, :3].T
    with np.errstate(divide="ignore"):
        distance = (offset - camera.center @ normal) / (rays @ normal)
    return np.where(distance > 0, distance, np.nan)
