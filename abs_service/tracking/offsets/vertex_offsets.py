"""Offsets of the vertices from the model's surface along its normals (o of eq. 7), learnt over frames.

The mesh is made from one depth image, so its offsets contain that image's noise; and fur, folds and fingers change in
ways that a surface of few control points cannot represent. After every frame, each vertex's offset is measured by its
pixels with their noise: by the residual after the search, so that theta explains as much as it can. One scalar Kalman
filter per vertex collects this evidence; with a random walk, evidence fades.

The offsets are the most probable ones by the evidence and a prior (`offset_field.py`), which keeps them a surface. The
offsets vary as much, and neighbours differ as much, as the first frame shows beyond its noise. Offsets that
change, by a random walk that is drawn back in `REST_S` (an Ornstein–Uhlenbeck process), are held at those of the first
frame, and tilt edges little. Vertices that are seen at a grazing angle or folded learn nothing from
their pixels, and none moves farther than half an edge from where it was in the first frame.
"""

from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from abs_service.pairing.images import DepthImage, Image
from abs_service.tracker.mesh import Mesh, edge_lengths
from abs_service.tracker.models.base import Surface
from abs_service.tracker.posterior.covariance.misfit import CommonDistance
from abs_service.tracking.offsets.heights import Heights, HeightSensor
from abs_service.tracking.offsets.offset_field import OffsetField, change_prior, offset_prior
from calib.jit import kernel
from calib.noise.base import DepthNoise
from calib.rig import Sensor

#: Time after which a changed offset is drawn back to rest by 63 % [s].
REST_S = 5.0

#: σ of the angle by which a change of offsets tilts an edge of the mesh [rad]: two of them lengthen it by 8 %.
TILT = 0.2

#: An offset changes by no more than this share of the edges around it.
MAX_CHANGE = 0.5

#: A face is folded if the cosine of its angle to the surface is below this; its vertices are not measured.
MIN_FACING = 0.3

#: The longest time step of the random walk [s], and the least σ of a first offset [m].
MAX_INTERVAL_S, MIN_DEVIATION_M = 0.5, 1e-5


@dataclass(frozen=True)
class Settings:
    """TOML keys of `vertex_offsets`.

    Attributes:
        random_walk: standard deviation of the change of an offset in one second [m/√s]; with 0, the offsets are
            constant, averaged over all frames. Models without offsets, all but `nurbs`, need 0.
    """

    random_walk: Annotated[float, Ge(0)] = 0.0

    def build(self, model: object, sensor: Sensor) -> "VertexOffsets":
        """The offsets of a model; fixed ones if the model has none, or the sensor measures no depth."""
        if isinstance(model, OffsetModel) and isinstance(sensor.noise, DepthNoise):
            return LearntOffsets(model, sensor, sensor.noise, self.random_walk)
        return FixedOffsets()


@runtime_checkable
class OffsetModel(Protocol):
    """A model whose vertices have offsets.

    Attributes:
        mesh: its mesh, with the current σ of the offsets as `deviation`.
        rest: parameters Θ⁰ (dim,).
        offset: offsets of the vertices along their normals (n,) [m].
    """

    mesh: Mesh
    rest: NDArray[np.float64]

    @property
    def offset(self) -> NDArray[np.floating]:
        """See above."""
        ...

    def set_offsets(self, offset: NDArray[np.float64], deviation: NDArray[np.float64]) -> None:
        """Replaces the offsets (n,) [m], which are known with a standard deviation (n,) [m]."""
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


class LearntOffsets:
    """Evidence of every vertex and the field of all; see the module.

    The first update takes nothing from its image, which the mesh was made from.

    Args:
        model: the model whose offsets are updated.
        sensor, noise: the depth sensor that measures them, and its noise model.
        random_walk: see `Settings`.

    Attributes:
        variance: of every offset (n,) [m²].
    """

    def __init__(self, model: OffsetModel, sensor: Sensor, noise: DepthNoise, random_walk: float):
        mesh = model.mesh
        deviation = np.maximum(np.broadcast_to(mesh.deviation, len(mesh.vertices)), MIN_DEVIATION_M)
        self.variance = deviation**2
        self._model, self._random_walk = model, random_walk
        self._heights = HeightSensor(sensor.camera, noise, mesh)
        self._field = OffsetField(mesh)
        self._common = CommonDistance(mesh)
        self._first = self._mean = self._offset = np.array(model.offset, np.float64)
        self._precision = 1 / self.variance
        self._around = edges_around(mesh)
        self._lowest, self._highest = (self._first + sign * MAX_CHANGE * self._around for sign in (-1, 1))
        self._prior = offset_prior(self._first, deviation, mesh, len(model.rest))
        self._t_ns: int | None = None

    def update(self, image: Image | None, surface: Surface, t_ns: int) -> None:
        """Adds the evidence of one image; outliers and missing measurements are none."""
        if self._t_ns is None:
            self._t_ns = t_ns
            self._begin()
            return
        elapsed_s, self._t_ns = max(t_ns - self._t_ns, 0) * 1e-9, t_ns
        faded = self._random_walk**2 * min(elapsed_s, MAX_INTERVAL_S)
        self._precision = self._precision / (1 + self._precision * faded)
        if isinstance(image, DepthImage):
            self._observe(image, surface)
        self._infer()

    def _begin(self) -> None:
        """Infers the offsets of the first frame; with a random walk, they change from then on."""
        self._infer()
        if self._random_walk:
            change = self._random_walk**2 * REST_S / 2  # variance of the process after a long time
            self._prior = change_prior(self._offset, self.variance + change, TILT * float(np.median(self._around)))

    def _observe(self, image: DepthImage, surface: Surface) -> None:
        vertices, normals = (values[0].T.astype(np.float64) for values in (surface.vertices, surface.normals))
        heights = self._heights.measure(image, vertices, normals, self.variance)
        gained = np.where(folded(vertices, normals, self._model.mesh.faces), 0, heights.precision)
        if not self._random_walk:
            gained = np.where(self._missed(heights), 0, gained)
        total = self._precision + gained
        self._mean = self._mean + gained / total * (self._offset + heights.mean - self._mean)
        self._precision = total

    def _missed(self, heights: Heights) -> NDArray[np.bool_]:
        """Mask (n,) of the vertices around which the model misses the surface: all heights are off to the same side."""
        measured = heights.precision > 0
        noise = np.where(measured, 1 / np.where(measured, heights.precision, 1) + self.variance, 0)
        return self._common.excess(heights.mean, noise) > 0

    def _infer(self) -> None:
        """The most probable offsets, bounded by the lengths of their vertices' edges."""
        offset = self._field.solve(self._mean, self._precision, self._prior, self._offset)
        self._offset = np.minimum(np.maximum(offset, self._lowest), self._highest)
        self.variance = self._field.variance(self._precision, self._prior)
        self._model.set_offsets(self._offset, np.sqrt(self.variance))


def folded(vertices: NDArray[np.float64], normals: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Mask (n,) of the vertices of folded faces: of faces that are turned away from the surface.

    Args:
        vertices, normals: of the mesh (n, 3) [m], and unit normals of the surface that it is bound to (n, 3).
        faces: vertex indices (m, 3).
    """
    result = np.zeros(len(vertices), bool)
    _mark_folded(vertices, normals, faces, result)
    return result


@kernel
def _mark_folded(
    vertices: NDArray[np.float64], normals: NDArray[np.float64], faces: NDArray[np.int32], result: NDArray[np.bool_]
) -> None:
    """Marks in `result` what `folded` returns."""
    for f in range(faces.shape[0]):
        a, b, c = faces[f]
        ux, uy, uz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
        wx, wy, wz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        facing = x * (normals[a, 0] + normals[b, 0] + normals[c, 0])
        facing += y * (normals[a, 1] + normals[b, 1] + normals[c, 1])
        facing += z * (normals[a, 2] + normals[b, 2] + normals[c, 2])
        if facing / 3 < MIN_FACING * np.sqrt(x * x + y * y + z * z):
            result[a] = result[b] = result[c] = True


def edges_around(mesh: Mesh) -> NDArray[np.float64]:
    """Mean length (n,) [m] of every vertex's edges."""
    ends = mesh.edges
    length = edge_lengths(mesh.vertices, ends)
    total, count = (np.bincount(ends.ravel(), weights, len(mesh.vertices)) for weights in (length.repeat(2), None))
    return total / count
