"""How far each vertex stands off the surface that deforms it, o of eq. 7, learnt while tracking.

The mesh is made from one depth image, so its relief carries that image's noise; and fur, folds and fingers change in
ways that no surface of few control points follows. Here every offset is a random walk along the vertex's normal, seen
by the depth sensor once a frame, with the noise of its pixel: one Kalman filter for each vertex. What Θ can do is left
to Θ, because an offset learns only what the search has left over, and only for the frames that follow.
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

#: Time assumed before the first two frames, and the longest that offsets drift unseen [s].
FIRST_INTERVAL_S, LONGEST_INTERVAL_S = 1 / 30, 0.5

#: A measurement that differs by more deviations shows something else.
INLIER_DEVIATIONS = 3.0

#: Cosine between sight and normal below which a distance says little about the offset.
LEAST_COSINE = 0.3


@dataclass(frozen=True)
class Settings:
    """TOML keys of `relief`.

    Attributes:
        drift: standard deviation of the change of a vertex's offset in one second [m/√s]; 0 leaves every offset as the
            first frame shows it. Models without offsets, all but `nurbs`, need 0.
    """

    drift: Annotated[float, Ge(0)] = 0.0

    def build(self, model: object, sensor: Sensor) -> "Relief":
        """What learns the offsets of a model, if it has any, from a depth sensor."""
        if self.drift == 0 or not (isinstance(model, Raisable) and isinstance(sensor.noise, DepthNoise)):
            return FixedRelief()
        return LearntRelief(model, sensor, sensor.noise, self.drift)


@runtime_checkable
class Raisable(Protocol):
    """A model whose vertices have offsets.

    Attributes:
        mesh: its mesh.
    """

    mesh: Mesh

    def raise_vertices(self, by: NDArray[np.float64]) -> None:
        """Adds lengths (n,) [m] to the offsets of the vertices along their normals."""
        ...


class Relief(Protocol):
    """What learns the offsets of one model."""

    def learn(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """Takes the depth image (None: there is none), the surface found in it, a population of one, and its time."""
        ...


class FixedRelief:
    """Offsets as the first frame shows them."""

    def learn(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """Nothing."""


class LearntRelief:
    """A Kalman filter for every vertex; see the module.

    Args:
        model: whose offsets it changes.
        sensor, noise: the depth sensor that sees them, and its noise model.
        drift: see `Settings`.

    Attributes:
        variance: of every offset (n,) [m²].
    """

    def __init__(self, model: "Raisable", sensor: Sensor, noise: DepthNoise, drift: float):
        self.variance = np.array(np.broadcast_to(model.mesh.deviation**2, len(model.mesh.vertices)))
        self._model = model
        self._camera = sensor.camera
        self._noise = noise
        self._drift = drift
        self._t_ns: int | None = None

    def learn(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """Moves every offset towards what the image shows, as far as both are trusted."""
        elapsed_s = FIRST_INTERVAL_S if self._t_ns is None else max(t_ns - self._t_ns, 0) * 1e-9
        self._t_ns = t_ns
        self.variance += self._drift**2 * min(elapsed_s, LONGEST_INTERVAL_S)
        if not isinstance(image, DepthImage):
            return
        vertices, normals = (values[0].T.astype(np.float64) for values in (surface.vertices, surface.normals))
        sight = vertices - self._camera.center
        distance = np.linalg.norm(sight, axis=1)
        cosine = np.abs(np.einsum("ni,ni->n", normals, sight)) / distance
        farther, deviation = self._measured(image, vertices, distance)
        # Along the sight, a vertex that is raised by o comes nearer by o / cosine: normals face the sensors.
        wanted, variance = -farther * cosine, (deviation * cosine) ** 2
        with np.errstate(invalid="ignore"):
            use = (cosine > LEAST_COSINE) & (wanted**2 < INLIER_DEVIATIONS**2 * (self.variance + variance))
        gain = np.where(use, self.variance / (self.variance + np.where(use, variance, 1.0)), 0.0)
        self.variance *= 1 - gain
        self._model.raise_vertices(gain * np.where(use, wanted, 0.0))

    def _measured(
        self, image: DepthImage, vertices: NDArray[np.float64], distance: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """How much farther than each vertex its pixel measured, and its deviation, each (n,) [m]; NaN: nothing."""
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
