"""Offsets of the vertices from the model's surface along its normals (o of eq. 7), filtered over frames.

The mesh is made from one depth image, so its offsets contain that image's noise; and fur, folds and fingers change in
ways that a surface of few control points cannot represent. Each offset is modelled as a random walk along its vertex's
normal, measured once per frame by the depth sensor with the noise of its pixel: one scalar Kalman filter per vertex.
Its measurement is the residual after the search, so theta explains as much as it can.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Image
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import Surface
from calib.noise.base import DepthNoise
from calib.rig import Sensor

#: Time assumed before the first frame, and the longest time step of the random walk [s].
FIRST_INTERVAL_S, LONGEST_INTERVAL_S = 1 / 30, 0.5

#: A measurement that differs by more standard deviations is an outlier.
INLIER_DEVIATIONS = 3.0

#: Measurements at a smaller cosine between line of sight and normal are ignored: they hardly constrain the offset.
LEAST_COSINE = 0.3


@dataclass(frozen=True)
class Settings:
    """TOML keys of `vertex_offsets`.

    Attributes:
        random_walk: standard deviation of the change of an offset in one second [m/√s]; 0 keeps the offsets of the
            first frame. Models without offsets, all but `nurbs`, need 0.
    """

    random_walk: Annotated[float, Ge(0)] = 0.0

    def build(self, model: object, sensor: Sensor) -> "VertexOffsets":
        """The filter of a model's offsets; fixed offsets if the model has none, or the sensor measures no depth."""
        if self.random_walk == 0 or not (isinstance(model, OffsetModel) and isinstance(sensor.noise, DepthNoise)):
            return FixedOffsets()
        return FilteredOffsets(model, sensor, sensor.noise, self.random_walk)


@runtime_checkable
class OffsetModel(Protocol):
    """A model whose vertices have offsets.

    Attributes:
        mesh: its mesh.
    """

    mesh: Mesh

    def add_offsets(self, by: NDArray[np.float64]) -> None:
        """Adds lengths (n,) [m] to the offsets of the vertices along their normals."""
        ...


class VertexOffsets(Protocol):
    """Vertex offsets of one model."""

    def update(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """Updates the offsets from a depth image (None: missing) and the estimated surface, a population of one."""
        ...


class FixedOffsets:
    """Constant offsets, those of the first frame."""

    def update(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """No operation."""


class FilteredOffsets:
    """A scalar Kalman filter per vertex; see the module.

    Args:
        model: the model whose offsets are updated.
        sensor, noise: the depth sensor that measures them, and its noise model.
        random_walk: see `Settings`.

    Attributes:
        variance: of every offset (n,) [m²].
    """

    def __init__(self, model: "OffsetModel", sensor: Sensor, noise: DepthNoise, random_walk: float):
        self.variance = np.array(np.broadcast_to(model.mesh.deviation**2, len(model.mesh.vertices)))
        self._model = model
        self._camera = sensor.camera
        self._noise = noise
        self._random_walk = random_walk
        self._t_ns: int | None = None

    def update(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """One prediction and update step of all filters; outliers and missing measurements are not used."""
        elapsed_s = FIRST_INTERVAL_S if self._t_ns is None else max(t_ns - self._t_ns, 0) * 1e-9
        self._t_ns = t_ns
        self.variance += self._random_walk**2 * min(elapsed_s, LONGEST_INTERVAL_S)
        if not isinstance(image, DepthImage):
            return
        vertices, normals = (values[0].T.astype(np.float64) for values in (surface.vertices, surface.normals))
        sight = vertices - self._camera.center
        distance = np.linalg.norm(sight, axis=1)
        cosine = np.abs(np.einsum("ni,ni->n", normals, sight)) / distance
        farther, deviation = self._measured(image, vertices, distance)
        # An offset o shortens the line of sight by o / cosine, because normals face the sensors.
        wanted, variance = -farther * cosine, (deviation * cosine) ** 2
        with np.errstate(invalid="ignore"):
            use = (cosine > LEAST_COSINE) & (wanted**2 < INLIER_DEVIATIONS**2 * (self.variance + variance))
        gain = np.where(use, self.variance / (self.variance + np.where(use, variance, 1.0)), 0.0)
        self.variance *= 1 - gain
        self._model.add_offsets(gain * np.where(use, wanted, 0.0))

    def _measured(
        self, image: DepthImage, vertices: NDArray[np.float64], distance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Residual of each vertex's pixel, measured minus vertex, and its σ, each (n,) [m]; NaN without measurement."""
        camera = self._camera
        column, row = np.floor(np.nan_to_num(camera.project(vertices), nan=-1.0) + 0.5).astype(np.int64).T
        inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
        x, a = np.full((2, len(vertices)), np.nan)
        x[inside], a[inside] = (part[row[inside], column[inside]] for part in (image.distance, image.amplitude))
        known = np.isfinite(x) & (x > 0) & (np.isfinite(a) | (not self._noise.uses_amplitude))
        pixels = row[known], column[known]
        farther, deviation = np.full((2, len(vertices)), np.nan)
        farther[known] = x[known] - self._noise.mean(distance[known], a[known], pixels) - distance[known]
        deviation[known] = self._noise.deviation(distance[known], a[known], pixels)
        return farther, deviation
