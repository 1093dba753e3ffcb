"""A flat sheet with vertex offsets, and depth images of it."""

from dataclasses import replace

import numpy as np

from abs_service.pairing.images import DepthImage
from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from calib.camera import Camera
from calib.noise.constant import Constant
from calib.rig import Sensor

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
SIGMA = 2e-3  # of a pixel [m]
NOISE = Constant(SIGMA)
SENSOR = Sensor("depth", CAMERA, NOISE)
ROWS, COLUMNS, STEP = 9, 12, 4  # vertices, and pixels from one to the next


def flat_mesh(deviation: float | np.ndarray = 1e-3) -> Mesh:
    """A sheet one metre away, square to the camera, with one vertex every four pixels and a σ of its vertices [m]."""
    grid = np.arange(ROWS * COLUMNS).reshape(ROWS, COLUMNS)
    row, column = np.divmod(grid.ravel(), COLUMNS)
    pixels = np.stack([6 + STEP * column, 6 + STEP * row], axis=-1)
    vertices = np.column_stack([(pixels - (CAMERA.cx, CAMERA.cy)) / CAMERA.fx, np.ones(len(pixels))])
    empty = np.zeros((len(vertices), 3), np.float32)
    deviation = np.broadcast_to(deviation, len(vertices))
    return Mesh(vertices, triangles(grid).astype(np.int32), empty, pixels / STEP, {}, deviation)


class Flat:
    """A model that cannot deform: a plane with offsets."""

    def __init__(self, offset: np.ndarray, deviation: float = 1e-3):
        self.mesh = flat_mesh(deviation)
        self.offset = offset
        self.rest = np.zeros(0)

    def set_offsets(self, offset: np.ndarray, deviation: np.ndarray) -> None:
        self.offset = offset
        self.mesh = replace(self.mesh, deviation=deviation)

    @property
    def surface(self) -> Surface:
        """The normals look back at the camera."""
        normals = np.tile([0.0, 0.0, -1.0], (len(self.offset), 1))
        vertices = self.mesh.vertices + self.offset[:, None] * normals
        return Surface(*(np.ascontiguousarray(part.T[None], np.float32) for part in (vertices, normals)))


def image(z: np.ndarray | float) -> DepthImage:
    """A depth image from z (height, width) [m]."""
    length = CAMERA.lookup.ray_length
    distance = np.asarray(np.broadcast_to(z, length.shape) * length, np.float32)
    return DepthImage(distance, np.full_like(distance, np.nan))


def offset_z(offsets: np.ndarray) -> np.ndarray:
    """z (height, width) [m] of a sheet whose vertices stand off by lengths (n,) [m], linear in between."""
    heights = offsets.reshape(ROWS, COLUMNS)
    of_row = [np.interp(np.arange(CAMERA.width), 6 + STEP * np.arange(COLUMNS), row) for row in heights]
    places = 6 + STEP * np.arange(ROWS)
    return 1 - np.transpose([np.interp(np.arange(CAMERA.height), places, column) for column in np.transpose(of_row)])
