"""NURBS deformation: vertices bound to a spline surface whose control points are the parameters (eqs. 2–8)."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from abs_service.tracker import resolution
from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh, edge_lengths
from abs_service.tracker.models.base import BOARD, ModelError, SparseJacobian, Surface, VertexBasis
from abs_service.tracker.models.parts import binding, spline
from abs_service.tracker.models.parts.bspline_patches import Patches
from calib.jit import kernel

ControlPoints = Annotated[int, Interval(ge=3, le=12)]


@dataclass(frozen=True)
class Settings:
    """TOML keys of the model.

    Attributes:
        control_points: numbers of control points along the object's long and short side; Θ has three values for each.
            "auto": 1 to 3 knot spans along the long side, so that the mean square error of a frame is least for the
            bend, the object's size, the number of vertices and the sensor's noise, and as many per length along the
            short side; fewer where the mesh is too coarse for them.
        degree: polynomial degree of the splines. "auto": 3, or less if a side has too few control points or cells of
            the mesh for it.
        bend_deg: angle between the normals of the two ends of the long side that the surface can follow, for
            `control_points = "auto"`. A camera sees a sheet that is bent by up to half a turn from end to end.
        margin: share of the object's size by which the rest surface extends beyond it on every side.
        weights: weight of every control point, a table of as many rows and columns; a larger weight than that of the
            neighbours pulls the surface towards the point. Empty: all 1, a plain B-spline surface.
        smoothing: weight of the bending of the rest surface relative to the squared distances to the vertices in its
            fit; it has an effect only where the object has no vertices. Up to a hundred times as much is used for an
            object with limbs or steps that the surface could not follow without bending too sharply.
    """

    has_offsets: ClassVar[Literal[True]] = True

    control_points: Literal["auto"] | tuple[ControlPoints, ControlPoints] = "auto"
    degree: Literal["auto"] | Annotated[int, Interval(ge=1, le=4)] = "auto"
    weights: tuple[tuple[Annotated[float, Interval(gt=0, le=1000)], ...], ...] = ()
    margin: Annotated[float, Interval(gt=0, le=0.5)] = 0.08
    smoothing: Annotated[float, Interval(gt=0, le=1)] = 1e-3
    bend_deg: Annotated[float, Interval(gt=0, le=1080)] = 180.0

    def __post_init__(self) -> None:
        if self.control_points == "auto":
            if self.weights:
                raise ValueError("weights need control_points = [long, short], the numbers of their rows and columns")
            return
        rows, columns = self.control_points
        if self.weights and [len(row) for row in self.weights] != [columns] * rows:
            given = ", ".join(str(len(row)) for row in self.weights)
            raise ValueError(
                f"weights must be {rows} rows of {columns} numbers, one for each of "
                f"control_points = [{rows}, {columns}], not rows of {given}"
            )

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board from which the model can be built: any."""
        return BOARD

    def build(self, detection: InitialDetection) -> "Nurbs":
        """The surface of an object of any smooth shape.

        Raises:
            ModelError, DetectionError: the object is too small, or cannot be bound to such a surface.
        """
        return self.of_mesh(grid_mesh(detection))

    def of_mesh(self, mesh: Mesh) -> "Nurbs":
        """Fits the rest surface to the mesh by least squares and binds every vertex to it.

        Raises:
            ModelError: too few control points for the degree, or the mesh cannot be bound to such a surface, as that of
                a closed body.
        """
        binding.check_chart(mesh)
        shape, degree = self.derived(mesh)
        if min(shape) <= degree:
            raise ModelError(
                f"control_points = {list(shape)} is too few for degree = {degree}: "
                f"each direction needs at least {degree + 1}"
            )
        weights = np.array(self.weights) if self.weights else np.ones(shape)
        control, u, w, offset = binding.fit_and_bind(mesh, weights, degree, self.margin, self.smoothing)
        return Nurbs(mesh, control, weights, degree, u, w, offset)

    def derived(self, mesh: Mesh) -> tuple[tuple[int, int], int]:
        """Numbers of control points along the long and the short side of a mesh, and the degree of the splines."""
        lengths, cells = _sides(mesh)
        if self.control_points != "auto":
            highest = min(resolution.CUBIC, min(self.control_points) - 1)
            return self.control_points, highest if self.degree == "auto" else self.degree
        degree = resolution.degree(cells) if self.degree == "auto" else self.degree
        bend_rad, noise_m = np.deg2rad(self.bend_deg), mesh.pixel_deviation
        along, across = resolution.spans(lengths, cells, len(mesh.vertices), noise_m, float(bend_rad), degree)
        # Three control points are the least that a side may have.
        return (max(along + degree, 3), max(across + degree, 3)), degree


def _sides(mesh: Mesh) -> tuple[tuple[float, float], tuple[float, float]]:
    """Lengths of the mesh along the axes of its chart [m], and numbers of edges on them, both approximate."""
    edges, size = mesh.edges, np.ptp(mesh.chart, axis=0)
    steps = np.abs(mesh.chart[edges[:, 1]] - mesh.chart[edges[:, 0]])
    lengths = edge_lengths(mesh.vertices, edges)
    along = [steps[:, axis] > 10 * steps[:, 1 - axis] for axis in range(2)]
    along = [own if own.any() else np.ones_like(own) for own in along]  # a mesh without edges along its chart
    step = np.array([np.median(steps[own, axis]) for axis, own in enumerate(along)])
    length = np.array([np.median(lengths[own]) for own in along])
    cells = size / step
    along_m, across_m = (cells * length).tolist()
    return (along_m, across_m), (float(cells[0]), float(cells[1]))


def second_differences(rows: int, columns: int) -> NDArray[np.float64]:
    """Second differences (k, rows · columns) of a grid of values; the sum of their squares is its thin-plate energy."""
    along, across = np.eye(rows), np.eye(columns)
    by_row, by_column = np.kron(np.diff(along, 2, axis=0), across), np.kron(along, np.diff(across, 2, axis=0))
    mixed = np.sqrt(2) * np.kron(np.diff(along, axis=0), np.diff(across, axis=0))
    return np.concatenate([by_row, by_column, mixed], dtype=np.float64)


class Nurbs:
    """A mesh bound to a NURBS surface; Θ lists x, y, z of the control points row by row [m].

    Attributes:
        mesh: the mesh, its vertices sorted by knot span; a vertex at the surface's edge is moved onto its normal there.
        rest: control points Θ⁰ (dim,) of the rest surface [m].
        scales: ones (dim,), because every parameter is a length.
        roughness: second differences (k, dim) of the control points' displacements along u and w, and mixed ones.
        prior: none (0, dim).
        derived: numbers of control points along the long and the short side, and degree, by their keys.
    """

    def __init__(
        self,
        mesh: Mesh,
        control: NDArray[np.float64],
        weights: NDArray[np.float64],
        degree: int,
        u: NDArray[np.float64],
        w: NDArray[np.float64],
        offset: NDArray[np.float64],
    ):
        shape = control.shape[:2]
        self.derived = {"control_points": tuple(map(float, shape)), "degree": (float(degree),)}
        span, self._span_control = spline.support(u, w, shape, degree)
        order = np.argsort(span, kind="stable")
        ordered = mesh.reordered(order)
        self.rest = control.reshape(-1)
        self.scales = np.ones_like(self.rest)
        self.roughness = np.asarray(np.kron(second_differences(*shape), np.eye(3)), np.float64)
        self.prior = np.zeros((0, self.rest.size))
        self._span_start = np.searchsorted(span[order], np.arange(len(self._span_control) + 1)).astype(np.int32)
        self._span = span[order]
        self._span_parameters = (3 * self._span_control[:, :, None] + np.arange(3)).reshape(len(self._span_control), -1)
        self._offset = offset[order].astype(np.float32)
        tables = spline.rational_basis(u[order], w[order], degree, weights)
        local = np.take_along_axis(np.stack(tables), self._span_control[span[order]][None], axis=2)
        self._basis = np.ascontiguousarray(local, np.float32)
        self._patches = Patches(u[order], w[order], offset[order], weights, degree)
        self.mesh = replace(ordered, vertices=self.deform(self.rest[None]).vertices[0].T.astype(np.float64))

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh (eq. 8) with every row of `thetas` (population, dim)."""
        return self._patches.deform(thetas)

    @property
    def offset(self) -> NDArray[np.float32]:
        """Offsets of the vertices along their normals (n,) [m]."""
        return self._offset

    @property
    def vertex_basis(self) -> VertexBasis:
        """Rational basis functions of every vertex, and their derivatives along both directions."""
        value, along_u, along_w = self._basis
        return VertexBasis(self._span_control[self._span], value, along_u, along_w)

    def set_offsets(self, offset: NDArray[np.float64], deviation: NDArray[np.float64]) -> None:
        """Replaces the vertex offsets (n,) [m], known with a standard deviation (n,) [m], in mesh and deformations."""
        self._offset = offset.astype(np.float32)
        self._patches.set_offsets(offset)
        vertices = self.deform(self.rest[None]).vertices[0].T.astype(np.float64)
        self.mesh = replace(self.mesh, vertices=vertices, deviation=deviation)

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Jacobian grouped by knot span: a vertex depends on the control points of its span only."""
        local = np.empty((len(self._offset), 3, self._span_parameters.shape[1]))
        _moves(theta.reshape(-1, 3), self._span_start, self._span_control, self._basis, self._offset, local)
        return SparseJacobian(local, self._span, self._span_parameters, len(theta))


@kernel
def _moves(
    control: NDArray[np.float64],
    span_start: NDArray[np.int32],
    span_control: NDArray[np.int32],
    basis: NDArray[np.float32],
    offset: NDArray[np.float32],
    result: NDArray[np.float64],
) -> None:
    """Jacobian of eq. 8 with respect to the control points: ∂D(v)/∂p = R_p I − o ∇R_p N̂ᵀ.

    The derivative of the unit normal N̂ with respect to p is −∇R_p N̂ᵀ, with the surface gradient
    ∇R_p = ∂R_p/∂u a + ∂R_p/∂w b. The dual basis of the tangents U and W with N = U × W is a = W × N̂/‖N‖ and
    b = N̂ × U/‖N‖.

    Args:
        control: (control points, 3).
        span_start: first vertex of every span, and the number of vertices, (spans + 1,).
        span_control: control points of every span (spans, q).
        basis: R, ∂R/∂u, ∂R/∂w of every vertex for its span's control points (3, n, q).
        offset: o of eq. 7 (n,).
        result: derivatives (n, 3, 3 · q) with respect to the control points of each vertex's span.
    """
    for s in range(span_control.shape[0]):
        for v in range(span_start[s], span_start[s + 1]):
            ux, uy, uz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for q in range(span_control.shape[1]):
                point, by_u, by_w = control[span_control[s, q]], basis[1, v, q], basis[2, v, q]
                ux, uy, uz = ux + by_u * point[0], uy + by_u * point[1], uz + by_u * point[2]
                wx, wy, wz = wx + by_w * point[0], wy + by_w * point[1], wz + by_w * point[2]
            nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
            inverse = 1 / np.sqrt(nx * nx + ny * ny + nz * nz + 1e-20)
            nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
            back = -offset[v] * inverse
            ax, ay, az = back * (wy * nz - wz * ny), back * (wz * nx - wx * nz), back * (wx * ny - wy * nx)
            bx, by, bz = back * (ny * uz - nz * uy), back * (nz * ux - nx * uz), back * (nx * uy - ny * ux)
            x_row, y_row, z_row = result[v, 0], result[v, 1], result[v, 2]
            for q in range(span_control.shape[1]):
                here, by_u, by_w, d = basis[0, v, q], basis[1, v, q], basis[2, v, q], 3 * q
                x, y, z = by_u * ax + by_w * bx, by_u * ay + by_w * by, by_u * az + by_w * bz
                x_row[d], x_row[d + 1], x_row[d + 2] = x * nx + here, x * ny, x * nz
                y_row[d], y_row[d + 1], y_row[d + 2] = y * nx, y * ny + here, y * nz
                z_row[d], z_row[d + 1], z_row[d + 2] = z * nx, z * ny, z * nz + here
