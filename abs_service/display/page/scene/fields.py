"""Quantities of the mesh's vertices that can be shown as colours, and the colours."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.mesh import Mesh
from calib.camera import Camera

Values = NDArray[np.float64]

#: Vertices without a value.
GREY = (128, 128, 128)

#: A vertex farther from its measurement has none: something else is in front of it, or nothing behind [m].
MAX_RESIDUAL_M = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class MeshView:
    """One estimate's mesh and the data that its colours show.

    Attributes:
        vertices, first: deformed and undeformed positions (n, 3) [m] in rig coordinates.
        faces: vertex indices (m, 3).
        covariance: of every vertex, (n, 6) [m²]: xx, xy, xz, yy, yz, zz; (0, 6) if unknown.
        measured: radial distances (height, width) [m] of its exposure, NaN without return; (0, 0) if there are none.
        camera: of that image; None if there is none.
        rim: classes of the vertices (n,), see `DeformedMesh.rim_classes_u8`; none if they are unknown.
    """

    vertices: NDArray[np.float64]
    first: NDArray[np.float64]
    faces: NDArray[np.int32]
    covariance: NDArray[np.float64]
    measured: NDArray[np.floating]
    camera: Camera | None
    rim: bytes = b""


@dataclass(frozen=True, slots=True, eq=False)
class ShownMesh:
    """A mesh that is shown.

    Attributes:
        view: of it.
        exposure_ns: time of its images, CLOCK_MONOTONIC [ns].
        state: of everything that its picture depends on; another one has to be drawn again.
    """

    view: MeshView
    exposure_ns: int
    state: object


def joined(views: Iterable[MeshView]) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.uint8]]:
    """Vertices (n, 3) [m], faces (m, 3) and classes of the rim (n,) of several meshes as one."""
    vertices, faces, classes, number = [np.empty((0, 3))], [np.empty((0, 3), np.int32)], [np.empty(0, np.uint8)], 0
    for view in views:
        vertices.append(view.vertices)
        faces.append(view.faces + np.int32(number))
        classes.append(np.frombuffer(view.rim or bytes(len(view.vertices)), np.uint8))
        number += len(view.vertices)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(classes)


def displacement(view: MeshView) -> Values:
    """Distance (n,) [mm] of every vertex from where it was first."""
    return 1e3 * np.linalg.norm(view.vertices - view.first, axis=1)


def sigma(view: MeshView) -> Values:
    """Root mean square (n,) [mm] of the error that the tracker expects; NaN if it is unknown."""
    if len(view.covariance) != len(view.vertices):
        return np.full(len(view.vertices), np.nan)
    return 1e3 * np.sqrt(view.covariance[:, [0, 3, 5]].sum(axis=1))


def curvature(view: MeshView) -> Values:
    """Mean curvature (n,) [1/m], positive where the surface bulges to the side that its faces show.

    The mean of the normal curvatures along the edges (G. Taubin, ICCV 1995), with equal weights.
    """
    mesh = Mesh(view.vertices, view.faces, np.empty((0, 3), np.float32), np.empty((0, 2)))
    normals, edges = mesh.normals, mesh.edges
    total, count = np.zeros(len(view.vertices)), np.zeros(len(view.vertices))
    for here, there in (edges.T, edges[:, ::-1].T):
        along = view.vertices[there] - view.vertices[here]
        squared = np.maximum(np.einsum("ij,ij->i", along, along), 1e-12)
        np.add.at(total, here, -2 * np.einsum("ij,ij->i", normals[here], along) / squared)
        np.add.at(count, here, 1)
    return total / np.maximum(count, 1)


def residual(view: MeshView) -> Values:
    """Measured minus synthesised distance (n,) [mm] at the pixel of every vertex (eqs. 11, 20); NaN without return."""
    found = np.full(len(view.vertices), np.nan)
    if view.camera is None:
        return found
    column, row = np.floor(view.camera.project(view.vertices) + 0.5).T
    height, width = view.measured.shape
    seen = np.flatnonzero((column >= 0) & (column < width) & (row >= 0) & (row < height))
    measured = view.measured[row[seen].astype(int), column[seen].astype(int)]
    found[seen] = measured - view.camera.distance(view.vertices[seen])
    return 1e3 * np.where(np.abs(found) < MAX_RESIDUAL_M, found, np.nan)


@dataclass(frozen=True, slots=True)
class Field:
    """A quantity that can be shown: its values, its unit and whether it has a sign."""

    values: Callable[[MeshView], Values]
    unit: str
    signed: bool = False


FIELDS: Mapping[str, Field] = {
    "displacement": Field(displacement, "mm"),
    "residual": Field(residual, "mm", signed=True),
    "σ": Field(sigma, "mm"),
    "curvature": Field(curvature, "1/m", signed=True),
}


def palette(signed: bool) -> NDArray[np.uint8]:
    """256 colours (256, 3): viridis, or blue over white to red for values with a sign."""
    if not signed:
        bgr = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_VIRIDIS)
        return np.array(bgr[:, 0, ::-1], np.uint8)
    place = np.linspace(-1, 1, 256)[:, None]
    ends = np.where(place < 0, (40, 90, 200), (205, 50, 40))
    return (np.abs(place) * ends + (1 - np.abs(place)) * 240).astype(np.uint8)


PALETTES = {signed: palette(signed) for signed in (False, True)}


def nice(value: float) -> float:
    """The next of 1, 2, 5, 10, 20 … that is not smaller."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-6)))
    return float(next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9)))


class ColorScale:
    """Colours of values; the end of the scale follows them and falls slowly, so that colours do not flicker."""

    def __init__(self, field: Field) -> None:
        self._field = field
        self._largest = 0.0

    @property
    def end(self) -> float:
        """Value with the last colour, in the field's unit."""
        return nice(self._largest)

    def colors(self, values: Values) -> NDArray[np.uint8]:
        """Red, green, blue (n, 3); grey where there is no value."""
        known = np.isfinite(values)
        if known.any():
            self._largest = max(float(np.percentile(np.abs(values[known]), 98)), 0.99 * self._largest)
        share = np.where(known, values, 0.0) / self.end
        share = (share + 1) / 2 if self._field.signed else share
        shown = PALETTES[self._field.signed][(255 * np.clip(share, 0, 1)).astype(np.uint8)]
        return np.where(known[:, None], shown, GREY).astype(np.uint8)
