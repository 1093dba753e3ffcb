"""The sheet of E1 as a model whose rest shape is known, so that control points correspond to the true ones."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import BOARD
from abs_service.tracker.models.nurbs import Nurbs
from calib.noise.base import DepthNoise
from calib.noise.images.intensity import GaussianIntensity
from calib.rig import Rig, Sensor
from evaluation.scenes.geometries import ASPECT
from evaluation.scenes.printed_sheet import FULL_SCALE, GREY_DEVIATION
from evaluation.scenes.surfaces import SplineSurface
from evaluation.scenes.time_of_flight import SR4000


def rig_of(noise: DepthNoise) -> Rig:
    """The camera as two sensors: distances with this noise model, and a grey image of the room's light."""
    grey = GaussianIntensity("intensity", GREY_DEVIATION, 0.0, "passive", FULL_SCALE)
    sensors = (Sensor("tof", SR4000, noise), Sensor("tof/intensity", SR4000, grey))
    return Rig("geometries", {sensor.name: sensor for sensor in sensors})


@dataclass(frozen=True)
class KnownSheet:
    """Settings of a model whose sheet is known: `nurbs` with the true control points at rest.

    Attributes:
        width, distance: of the sheet at rest, see `Motion`.
        vertices: about how many vertices it has.
        inset: how far vertices keep away from the rim, as a share of the width; 0.02 are 1.7 pixels, and there no
            pixel is mixed.
    """

    width: float
    distance: float
    vertices: int = 600
    inset: float = 0.02

    @property
    def board(self) -> tuple[float, float]:
        """Board of the sheet's size; any would do."""
        return BOARD

    @cached_property
    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Parameters u (rows,) and w (columns,) of the vertices."""
        rows = round(np.sqrt(self.vertices * ASPECT))
        columns = round(self.vertices / rows)
        return np.linspace(self.inset / ASPECT, 1 - self.inset / ASPECT, rows), np.linspace(
            self.inset, 1 - self.inset, columns
        )

    @property
    def control(self) -> NDArray[np.float64]:
        """Control points (4, 4, 3) [m] of a flat sheet of degree 2: they lie at the means of two successive knots."""
        at = np.array([0.0, 0.25, 0.75, 1.0]) - 0.5
        y, x = np.meshgrid(ASPECT * self.width * at, self.width * at, indexing="ij")
        return np.stack([x, y, np.full_like(x, self.distance)], axis=-1)

    @property
    def faces(self) -> NDArray[np.int32]:
        """Triangles (m, 3) between the vertices, whose normals point to the camera."""
        rows, columns = map(len, self.places)
        place = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
        a, b, c, d = (part.ravel() for part in (place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]))
        return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])

    def build(self, detection: InitialDetection) -> Nurbs:
        """The model of the sheet, which lies exactly where the first frame shows it."""
        u, w = (part.ravel() for part in np.meshgrid(*self.places, indexing="ij"))
        points = SplineSurface((4, 4), 2, *self.places).points(self.control).reshape(-1, 3)
        unknown = np.full((len(points), 3), np.nan, np.float32)
        mesh = Mesh(points, self.faces, unknown, np.stack([w, ASPECT * u], axis=1))
        return Nurbs(mesh, self.control, np.ones((4, 4)), 2, u, w, np.zeros(len(u)))
