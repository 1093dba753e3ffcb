"""FlexPad: a sheet that bends in four directions through its centre, each side on its own (Steimle, Jordt, Maes)."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from abs_service.tracker.models import bends
from abs_service.tracker.models.arc import arc
from abs_service.tracker.models.base import BOARD, Moves, Surface
from abs_service.tracker.rectangle import find_sheet
from abs_service.tracker.sheet import Sheet
from abs_service.tracker.sighting import Sighting
from calib import pose
from calib.jit import kernel, prange

#: Θ: bends of the eight sides, height map, rotation vector, translation.
BENDS, HEIGHT, ROTATION, TRANSLATION = slice(0, 8), 8, slice(9, 12), slice(12, 15)
DIMENSION = 15

#: Largest parameter of the height map. Heights up to half the sheet's long side stay in order with it.
FULL_HEIGHT = 0.5

#: Standard deviation of the height map's parameter before any measurement.
HEIGHT_DEVIATION = 0.2


@dataclass(frozen=True)
class Settings:
    """TOML keys of the model.

    Attributes:
        width_m, height_m: long and short side of the sheet [m]; 0 takes what is detected.
        size_tolerance: relative difference between a given and the detected side up to which it is the sheet.
        least_radius_m: radius [m] of the sheet when a bend is 2, its largest value.
        bend_deviation: standard deviation of a bend before any measurement. Opposite bends of neighbouring directions
            nearly cancel, and measurements alone do not say how large both are.
    """

    width_m: Annotated[float, Interval(ge=0, le=10)] = 0.0
    height_m: Annotated[float, Interval(ge=0, le=10)] = 0.0
    size_tolerance: Annotated[float, Interval(ge=0.05, lt=1)] = 0.15
    least_radius_m: Annotated[float, Gt(0)] = 0.1
    bend_deviation: Annotated[float, Gt(0)] = 1.0

    def __post_init__(self) -> None:
        if (self.width_m == 0) != (self.height_m == 0):
            raise ValueError("width_m and height_m belong together: give both, or neither")

    @property
    def board(self) -> tuple[float, float]:
        """Width and height [m] of a flat board that the model can be built from: the sheet."""
        return (self.width_m, self.height_m) if self.width_m else BOARD

    def build(self, sighting: Sighting) -> "FlexPad":
        """The model of a flat sheet.

        Raises:
            SightingError: what is seen is no flat rectangle, or not of the given size.
        """
        sheet = find_sheet(sighting)
        if self.width_m:
            sheet = sheet.of_size(self.width_m, self.height_m, self.size_tolerance)
        return FlexPad(sheet, sighting.vertices, self.least_radius_m, self.bend_deviation)


class FlexPad:
    """Θ = 8 bends in [−2, 2], height map in [−½, ½], rotation vector [rad] about the sheet's centre, translation [m].

    The bends come in pairs, one for either side of the directions 0°, 45°, 90° and 135° from the sheet's long side;
    positive ones bend towards the sensor. Displacements of the sides add up, then heights z (towards the sensor) become
    z + g z²/c with c half the long side, then the pose is applied. Bends and g beyond their range count as its end.

    Attributes:
        mesh: a grid on the flat sheet.
        rest: zeros (15,).
        scales: (15,).
        prior: bends and height map are normal around zero (9, 15).
    """

    def __init__(self, sheet: Sheet, vertices: int, least_radius: float, bend_deviation: float):
        mesh = sheet.mesh(vertices)
        points = pose.transform(pose.inverse(sheet.T_rp), mesh.vertices)[:, :2]
        self._points = np.ascontiguousarray(points.T, np.float32)
        self._half = 0.5 * sheet.width
        self._rotation, self._center = sheet.T_rp[:3, :3], sheet.T_rp[:3, 3]
        self._pose = np.ascontiguousarray(sheet.T_rp[:3], np.float64)
        self._sides = bends.SIDES.astype(np.float32)
        self._kappa = bends.curvatures(np.linalg.norm(points, axis=1).max(), least_radius)
        self._tables = bends.tabulate(points, self._kappa)
        self.rest = np.zeros(DIMENSION)
        self.scales = _scales(points, least_radius, self._half)
        self.prior = np.eye(9, DIMENSION) / np.array([bend_deviation] * 8 + [HEIGHT_DEVIATION])[:, None]
        self.mesh = mesh

    def deform(self, thetas: NDArray[np.float64]) -> Surface:
        """Deforms the mesh with every row of `thetas` (population, 15)."""
        population, n = len(thetas), self._points.shape[1]
        row, fraction = np.empty((population, 8), np.int32), np.empty((population, 8), np.float32)
        height, motion = np.empty(population, np.float32), np.empty((population, 3, 4), np.float32)
        limits = FULL_HEIGHT, self._half
        bends.look_up(thetas, self._pose, *limits, len(self._kappa), row, fraction, height, motion)
        vertices, normals = np.empty((population, 3, n), np.float32), np.empty((population, 3, n), np.float32)
        _deform(row, fraction, height, motion, self._points, self._sides, self._tables, vertices, normals)
        return Surface(vertices, normals)

    def jacobian(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives (n, 3, 15) of the vertices at theta (15,), by bends and g beyond their range none."""
        turn = pose.from_rotation_vector(theta[ROTATION], (0, 0, 0))[:3, :3]
        turned = self.deform(theta[None]).vertices[0].T - (self._center + theta[TRANSLATION])
        shifts = np.broadcast_to(np.eye(3), (len(turned), 3, 3))
        on_sheet = turn @ self._rotation @ self._slopes(theta[BENDS], theta[HEIGHT])
        return np.concatenate([on_sheet, pose.turning(theta[ROTATION], turned), shifts], axis=2)

    def moves(self, theta: NDArray[np.float64]) -> Moves:
        """As `jacobian`: every parameter moves every vertex."""
        return Moves.full(self.jacobian(theta))

    def _slopes(self, bend: NDArray[np.float64], height: float) -> NDArray[np.float64]:
        """Derivatives (n, 3, 9) of places on the sheet, z pointing away, by bends (8,) and height map.

        They are those of the exact bends; the tables' own would jump from row to row.
        """
        per_bend = self._kappa[-1] / bends.FULL
        bounded, g = np.clip(bend, -bends.FULL, bends.FULL), np.clip(height, -FULL_HEIGHT, FULL_HEIGHT)
        q = np.maximum(bends.SIDES @ self._points, 0.0)
        end, slope = arc((per_bend * bounded)[:, None] * q)
        rise = np.sum(q * end.imag, axis=0)
        by_bends = np.where(bounded == bend, per_bend, 0.0)[:, None] * q**2 * slope
        result = np.zeros((len(rise), 3, 9))
        result[:, :2, :8] = by_bends.real.T[:, None] * bends.SIDES.T
        result[:, 2, :8] = -(by_bends.imag * (1 + 2 * g / self._half * rise)).T
        result[:, 2, 8] = np.where(g == height, -(rise**2) / self._half, 0.0)
        return result


def _scales(points: NDArray[np.float64], least_radius: float, half: float) -> NDArray[np.float64]:
    """Size (15,) of each parameter that moves the farthest vertex by about a metre when the sheet is bent by 1."""
    reach = np.max(bends.SIDES @ points.T, axis=1)
    kappa = 1 / (bends.FULL * least_radius)
    rise = (1 - np.cos(kappa * reach)) / kappa
    radius = np.linalg.norm(points, axis=1).max()
    return np.concatenate([1 / rise, [half / rise.max() ** 2], np.full(3, 1 / radius), np.ones(3)])


@kernel
def _deform(
    row: NDArray[np.int32],
    fraction: NDArray[np.float32],
    height: NDArray[np.float32],
    motion: NDArray[np.float32],
    points: NDArray[np.float32],
    sides: NDArray[np.float32],
    tables: NDArray[np.float32],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
) -> None:
    """Sums the bends, maps the heights and applies the pose, for a population.

    Args:
        row, fraction: place of every bend between two rows of its table (population, 8).
        height: g/c of the height map (population,) [1/m].
        motion: rotation and translation from sheet to rig (population, 3, 4); the sheet's z axis points away.
        points: vertices on the flat sheet (2, n).
        sides: in-plane directions (8, 2).
        tables: as `tabulate` makes them.
        vertices, normals: results (population, 3, n).
    """
    one, two = np.float32(1), np.float32(2)
    n = points.shape[1]
    for k in prange(row.shape[0]):
        work = np.empty((8, n), np.float32)
        x, y, z, g, h = work[0], work[1], work[2], work[3], work[4]
        stretch_x, shear, stretch_y = work[5], work[6], work[7]
        work[2:] = 0
        work[0], work[1] = points[0], points[1]
        # Few arrays in each loop: else the compiler gives up proving that it may vectorise.
        for j in range(8):
            low, high, f = tables[j, row[k, j]], tables[j, row[k, j] + 1], fraction[k, j]
            a, b = sides[j, 0], sides[j, 1]
            for v in range(n):
                shift = low[0, v] + f * (high[0, v] - low[0, v])
                x[v] += a * shift
                y[v] += b * shift
            for v in range(n):
                z[v] += low[1, v] + f * (high[1, v] - low[1, v])
            for v in range(n):
                shrink = low[2, v] + f * (high[2, v] - low[2, v])
                stretch_x[v] += a * a * shrink
                shear[v] += a * b * shrink
                stretch_y[v] += b * b * shrink
            for v in range(n):
                slope = low[3, v] + f * (high[3, v] - low[3, v])
                g[v] += a * slope
                h[v] += b * slope
        for v in range(n):
            steep = one + two * height[k] * z[v]
            g[v] *= steep
            h[v] *= steep
            z[v] += height[k] * z[v] * z[v]
        # The cross product of the tangents by x and y, each the sum of the sides' derivatives.
        for v in range(n):
            across, along = one + stretch_x[v], one + stretch_y[v]
            u = along * g[v] - shear[v] * h[v]
            w = across * h[v] - shear[v] * g[v]
            t = across * along - shear[v] * shear[v]
            inverse = -one / np.sqrt(u * u + w * w + t * t + np.float32(1e-20))
            g[v], h[v], stretch_x[v] = u * inverse, w * inverse, t * inverse
        for i in range(3):
            r0, r1, r2, r3 = motion[k, i, 0], motion[k, i, 1], motion[k, i, 2], motion[k, i, 3]
            for v in range(n):
                vertices[k, i, v] = r0 * x[v] + r1 * y[v] - r2 * z[v] + r3
            for v in range(n):
                normals[k, i, v] = r0 * g[v] + r1 * h[v] + r2 * stretch_x[v]
