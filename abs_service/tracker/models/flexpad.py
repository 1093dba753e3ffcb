"""FlexPad: a sheet that bends along four directions through its centre, each side separately (Steimle, Jordt, Maes)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.detection.shapes.rectangle_fit import Limits, find_sheet
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet, rectangle_of
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import BOARD, ModelError, SparseJacobian, Surface
from abs_service.tracker.models.parts import bends
from abs_service.tracker.models.parts.bends import bend, bend_jacobian, roll
from abs_service.tracker.models.parts.rigid_transform import place
from abs_service.tracker.models.parts.tile_buffer import LANES, TILE, write
from calib import pose
from calib.jit import composed, kernel, prange

#: Θ: bends of the eight sides, height map, rotation vector, translation.
BENDS, HEIGHT, ROTATION, TRANSLATION = slice(0, 8), 8, slice(9, 12), slice(12, 15)
DIMENSION = 15

#: Largest parameter of the height map; up to it, the map is monotonic for heights up to half the sheet's long side.
FULL_HEIGHT = 0.5

#: Standard deviation of the height map's parameter before any measurement.
HEIGHT_DEVIATION = 0.2

#: Largest relative difference between given sides and those of a template.
SAME_SIZE = 0.01

#: Components of the diagonal directions along x and y, √½.
_ROOT = np.float32(np.sqrt(0.5))


@dataclass(frozen=True)
class Settings:
    """TOML keys of the model.

    Attributes:
        width_m: long side of the sheet [m]; 0 uses the detected length.
        height_m: short side of the sheet [m]; 0 uses the detected length.
        size_tolerance: largest relative difference between a given and the detected side; no effect with a template.
        minimum_radius_m: radius [m] of the sheet when a bend is 2, its largest value.
        bend_deviation: prior standard deviation of a bend. Opposite bends of neighbouring directions nearly cancel, so
            measurements alone do not determine their common magnitude.
        minimum_pixels: minimum number of pixels of the sheet in the first depth image; no effect with a template.
        maximum_bow_m: largest height by which the sheet may arch over its plane in the first depth image [m]; no effect
            with a template.
        minimum_gap_m: distance from the sheet's plane up to which a pixel belongs to it in the first depth image, or
            four deviations if that is more [m]; no effect with a template.
        minimum_overlap: minimum share of the pixels of the sheet or of the rectangle around it that both have in
            common in the first depth image; no effect with a template.
    """

    width_m: Annotated[float, Interval(ge=0, le=10)] = 0.0
    height_m: Annotated[float, Interval(ge=0, le=10)] = 0.0
    size_tolerance: Annotated[float, Interval(ge=0.05, lt=1)] = 0.15
    minimum_radius_m: Annotated[float, Gt(0)] = 0.1
    bend_deviation: Annotated[float, Gt(0)] = 1.0
    minimum_pixels: Annotated[int, Interval(ge=50)] = Limits.minimum_pixels
    maximum_bow_m: Annotated[float, Interval(gt=0, le=1)] = Limits.maximum_bow_m
    minimum_gap_m: Annotated[float, Interval(gt=0, le=0.1)] = Limits.minimum_gap_m
    minimum_overlap: Annotated[float, Interval(ge=0.5, lt=1)] = Limits.minimum_overlap

    def __post_init__(self) -> None:
        if (self.width_m == 0) != (self.height_m == 0):
            given = f"width_m = {self.width_m}, height_m = {self.height_m}"
            raise ValueError(f"{given}: they belong together; give both, or neither")

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board from which the model can be built: the sheet."""
        return (self.width_m, self.height_m) if self.width_m else BOARD

    def build(self, detection: InitialDetection) -> "FlexPad":
        """The model of a flat sheet.

        Raises:
            DetectionError: the object is not a flat rectangle, or not of the given size.
            ModelError: the sheet is too large for the least radius.
        """
        limits = Limits(self.minimum_pixels, self.maximum_bow_m, self.minimum_gap_m, self.minimum_overlap)
        sheet = find_sheet(detection, limits)
        if self.width_m:
            sheet = sheet.of_size(self.width_m, self.height_m, self.size_tolerance)
        return FlexPad(sheet, detection.vertices, self.minimum_radius_m, self.bend_deviation)

    def of_mesh(self, mesh: Mesh) -> "FlexPad":
        """The model of a flat rectangular mesh, with about as many vertices on a regular grid.

        Raises:
            ModelError: the mesh is no flat rectangle, or not of the given size, or too large for the least radius.
        """
        sheet = rectangle_of(mesh)
        if sheet is None:
            raise ModelError("flexpad is a flat rectangle, and the template is none; nurbs and rigid follow others")
        if self.width_m and not np.allclose(
            (sheet.width, sheet.height), sorted((self.width_m, self.height_m))[::-1], rtol=SAME_SIZE
        ):
            raise ModelError(
                f"the template is {sheet.width:.3f} m × {sheet.height:.3f} m, width_m × height_m is {self.width_m:g} m "
                f"× {self.height_m:g} m; leave the latter out"
            )
        return FlexPad(sheet, len(mesh.vertices), self.minimum_radius_m, self.bend_deviation)


class FlexPad:
    """Θ = 8 bends in [−2, 2], height map in [−½, ½], rotation vector [rad] about the sheet's centre, translation [m].

    The bends come in pairs, one for either side of the directions 0°, 45°, 90° and 135° from the sheet's long side;
    positive ones bend towards the sensor. Displacements of the sides are summed, then heights z (towards the sensor)
    become z + g z²/c with c half the long side, then the pose is applied. Bends and g outside their range are clamped.

    Attributes:
        mesh: a grid on the flat sheet.
        rest: zeros (15,).
        scales: (15,).
        roughness: none (0, 15).
        prior: (9, 15), Gaussian with zero mean for bends and height map.
    """

    def __init__(self, sheet: Sheet, vertices: int, minimum_radius: float, bend_deviation: float):
        mesh = sheet.mesh(vertices)
        points = pose.transform(pose.inverse(sheet.T_rp), mesh.vertices)[:, :2]
        self._points = np.ascontiguousarray(points.T)
        self._padded = np.ascontiguousarray(np.pad(self._points, ((0, 0), (0, LANES))), np.float32)
        self._half = 0.5 * sheet.width
        self._rotation, self._center = sheet.T_rp[:3, :3], sheet.T_rp[:3, 3]
        self._pose = np.ascontiguousarray(sheet.T_rp[:3], np.float64)
        self._per_bend = 1 / (bends.FULL * minimum_radius)
        self._series = bends.fit(float(np.linalg.norm(points, axis=1).max()), minimum_radius)
        roll = composed(bends.roll, ORDERS=self._series.coefficients.shape[1])
        self._deform = composed(_deform, roll=roll)
        self.rest = np.zeros(DIMENSION)
        self.scales = _scales(points, minimum_radius, self._half)
        self.roughness = np.zeros((0, DIMENSION))
        self.prior = np.eye(9, DIMENSION) / np.array([bend_deviation] * 8 + [HEIGHT_DEVIATION])[:, None]
        self.mesh = mesh

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh with every row of `thetas` (population, 15)."""
        shape = len(thetas), 3, self._points.shape[1]
        vertices, normals = np.empty(shape, np.float32), np.empty(shape, np.float32)
        sheet = self._pose, self._per_bend, self._half, self._padded
        self._deform(thetas, *sheet, self._series.coefficients, self._series.scale, vertices, normals)
        return Surface(vertices, normals)

    def sparse_jacobian(self, theta: NDArray[np.float64]) -> SparseJacobian:
        """Jacobian of the vertices with respect to theta, at theta (15,): one group; zero for clamped parameters."""
        turn = pose.from_rotation_vector(theta[ROTATION], (0, 0, 0))[:3, :3]
        turned = self.deform(theta[None]).vertices[0].T - (self._center + theta[TRANSLATION])
        result = np.empty((len(turned), 3, DIMENSION))
        sheet = self._points, np.matmul(turn, self._rotation), self._per_bend, self._half
        bend_jacobian(theta[BENDS], theta[HEIGHT], FULL_HEIGHT, bends.SIDES, *sheet, result)
        result[:, :, ROTATION] = pose.rotated_points_jacobian(theta[ROTATION], turned)
        result[:, :, TRANSLATION] = np.eye(3)
        return SparseJacobian.from_dense(result)


def _scales(points: NDArray[np.float64], minimum_radius: float, half: float) -> NDArray[np.float64]:
    """Change (15,) of each parameter that moves the farthest vertex by about one metre when the sheet is bent by 1."""
    reach = np.max(bends.SIDES @ points.T, axis=1)
    kappa = 1 / (bends.FULL * minimum_radius)
    rise = (1 - np.cos(kappa * reach)) / kappa
    radius = np.linalg.norm(points, axis=1).max()
    return np.concatenate([1 / rise, [half / rise.max() ** 2], np.full(3, 1 / radius), np.ones(3)])


@kernel
def _deform(
    thetas: NDArray[np.float64],
    pose: NDArray[np.float64],
    per_bend: float,
    half: float,
    points: NDArray[np.float32],
    series: NDArray[np.float32],
    scale: float,
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Vertices and normals of a population: sums the bends, maps the heights and applies the pose.

    Args:
        thetas: parameters (population, 15).
        pose: of the sheet in the rig (3, 4); its z axis points away from the sensor.
        per_bend: curvature of a side at a parameter of 1 [1/m].
        half: half the sheet's long side [m].
        points: vertices on the flat sheet (2, n + `LANES`) [m].
        series, scale: as in `bends.roll`.
        vertices, normals: results (population, 3, n).
    """
    one, two, r, n = np.float32(1), np.float32(2), _ROOT, vertices.shape[2]
    for k in prange(thetas.shape[0]):
        theta, w = thetas[k], np.empty((8, TILE), np.float32)
        e, se = bend(theta, 0, per_bend), bend(theta, 1, per_bend)
        s, sw = bend(theta, 2, per_bend), bend(theta, 3, per_bend)
        height = np.float32(min(max(theta[8], -FULL_HEIGHT), FULL_HEIGHT) / half)
        of_x, of_y, of_z = place(theta[9:12], theta[12:15], pose)
        for first in range(0, n, TILE):
            count, xs, ys = min(TILE, n - first), points[0, first:], points[1, first:]
            lanes = np.uintp((count + LANES - 1) // LANES * LANES)
            # Two loops: a single one would leave too few vertices in flight for the processor's execution units.
            for v in range(lanes):
                x, y = xs[v], ys[v]
                shift_0, z_0, shrink_0, g_0 = roll(x, e, series, scale)
                shift_1, z_1, shrink_1, g_1 = roll(r * (x + y), se, series, scale)
                shift_2, z_2, shrink_2, g_2 = roll(y, s, series, scale)
                shift_3, z_3, shrink_3, g_3 = roll(r * (y - x), sw, series, scale)
                shear, both = (shrink_1 - shrink_3) / two, one + (shrink_1 + shrink_3) / two
                w[0, v], w[1, v] = x + shift_0 + r * (shift_1 - shift_3), y + shift_2 + r * (shift_1 + shift_3)
                w[2, v], w[3, v], w[4, v] = z_0 + z_1 + z_2 + z_3, g_0 + r * (g_1 - g_3), g_2 + r * (g_1 + g_3)
                w[5, v], w[6, v], w[7, v] = both + shrink_0, both + shrink_2, shear
            for v in range(lanes):
                x, y, z, across, along, shear = w[0, v], w[1, v], w[2, v], w[5, v], w[6, v], w[7, v]
                steep = one + two * height * z
                z, g, h = z + height * z * z, w[3, v] * steep, w[4, v] * steep
                # Cross product of the tangents ∂/∂x and ∂/∂y, each the sum of the sides' derivatives.
                a, b, d = along * g - shear * h, across * h - shear * g, across * along - shear * shear
                inverse = -one / np.sqrt(a * a + b * b + d * d + np.float32(1e-20))
                a, b, d = a * inverse, b * inverse, d * inverse
                # Unrolled, because the compiler does not vectorise the enclosing loop around a loop over coordinates.
                w[0, v] = of_x[0] * x + of_x[1] * y - of_x[2] * z + of_x[3]
                w[1, v] = of_y[0] * x + of_y[1] * y - of_y[2] * z + of_y[3]
                w[2, v] = of_z[0] * x + of_z[1] * y - of_z[2] * z + of_z[3]
                w[3, v] = of_x[0] * a + of_x[1] * b + of_x[2] * d
                w[4, v] = of_y[0] * a + of_y[1] * b + of_y[2] * d
                w[5, v] = of_z[0] * a + of_z[1] * b + of_z[2] * d
            write(w, first, count, vertices[k], normals[k])
