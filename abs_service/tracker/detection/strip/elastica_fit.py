"""Fit of a hanging strip: its plane of bending, and the heavy elastica closest to its points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from abs_service.tracker.detection.strip.elastica import Elastica, heavy_elastica

Vector = NDArray[np.float64]

#: Typical error of a distance [m]; scale of the robust loss, which down-weights points far from the fitted shape.
NOISE_M = 5e-3

#: Points farther away than this multiple of the noise are outliers: another object, or a mixed pixel.
MAX_GAP = 3.0

#: Step of the numerical derivatives: of a position [m], an angle [rad], and the logarithm of a load.
STEP = 1e-3

#: Range of loads w L³ / D: from a strip that sags by a thousandth of its length to a thread.
LOADS = (1e-2, 300.0)


@dataclass(frozen=True, eq=False)
class Plane:
    """The plane of bending: unit vectors across (along the gripper line), ahead (horizontal) and down, in the rig."""

    across: Vector
    ahead: Vector
    down: Vector

    def coordinates(self, points: NDArray[np.float64]) -> tuple[Vector, NDArray[np.float64]]:
        """Coordinate across (n,) and the point in the plane of bending (n, 2) [m]."""
        return points @ self.across, np.stack([points @ self.ahead, points @ self.down], axis=-1)

    def normals(self, phi: Vector) -> NDArray[np.float64]:
        """Normals (n, 3) in the rig of a curve with inclination φ (n,)."""
        return normals_at(phi) @ np.array([self.ahead, self.down])

    def tilted(self, tilt: NDArray[np.float64]) -> "Plane":
        """The plane with `across` tilted ahead and down by `tilt` (2,); down stays as close to gravity as possible."""
        return _plane(self.across + tilt[0] * self.ahead + tilt[1] * self.down, self.down, self.ahead)


@dataclass(frozen=True, eq=False)
class FittedElastica:
    """An elastica in the plane of bending.

    Attributes:
        tip: inclination at the free end [rad].
        load: w L³ / D.
        middle: mean of its nodes (2,) [m].
        length: of the strip [m].
    """

    tip: float
    load: float
    middle: Vector
    length: float

    @cached_property
    def inclination(self) -> Vector:
        """Inclination of the nodes (STEPS + 1,) [rad]."""
        return self._shape.inclination[0]

    @cached_property
    def nodes(self) -> NDArray[np.float64]:
        """Points (STEPS + 1, 2) from the gripper to the free end [m]."""
        points = self.length * self._shape.points[0]
        return points - points.mean(axis=0) + self.middle

    def unroll(self, points: NDArray[np.float64]) -> tuple[Vector, Vector, Vector]:
        """Arc length from the gripper [m], normal distance [m] and inclination [rad], all closest to points (n, 2)."""
        nodes = self.nodes
        nearest = np.argmin(np.sum(nodes**2, axis=1) - 2 * points @ nodes.T, axis=1)
        phi, gap = self.inclination[nearest], points - nodes[nearest]
        tangent = np.stack([np.cos(phi), np.sin(phi)], axis=-1)
        along = nearest * (self.length / (len(nodes) - 1)) + np.sum(gap * tangent, axis=1)
        return along, np.sum(gap * normals_at(phi), axis=1), phi

    def cut(self, low: float, high: float) -> "FittedElastica":
        """Approximately the part from arc length `low` to `high`; extrapolated straight beyond the ends."""
        shift = (low + high - self.length) / 2
        slope = self.inclination[len(self.inclination) // 2]
        middle = self.middle + shift * np.array([np.cos(slope), np.sin(slope)])
        length = high - low
        return FittedElastica(self.tip, float(np.clip(self.load * (length / self.length) ** 3, *LOADS)), middle, length)

    @cached_property
    def _shape(self) -> Elastica:
        return heavy_elastica(self.tip, self.load)


def normals_at(phi: Vector) -> NDArray[np.float64]:
    """Unit normals (…, 2) of tangents with inclination φ (…)."""
    return np.stack([-np.sin(phi), np.cos(phi)], axis=-1)


def _plane(across: Vector, down: Vector, ahead: Vector) -> Plane:
    across = across / np.linalg.norm(across)
    down = down - (down @ across) * across
    down = down / np.linalg.norm(down)
    forward = np.cross(across, down)
    return Plane(across, forward if forward @ ahead > 0 else -forward, down)


def find_plane(points: NDArray[np.float64], gravity: Vector) -> Plane:
    """The plane across a horizontal gripper line along which all points project onto one curve, with the least skew.

    A bent strip is a cylinder, so its points project onto a curve along one direction only. A flat one does so along
    all directions of its plane; the skew of its outline then determines the direction, in a tie the shorter side.
    """
    some = np.cross(gravity, np.eye(3)[np.argmin(np.abs(gravity))])
    some /= np.linalg.norm(some)
    other = np.cross(gravity, some)
    turns = np.deg2rad(np.arange(0, 180, 2))[:, None]
    lines = np.asarray(np.cos(turns) * some + np.sin(turns) * other, np.float64)
    frames = [_plane(line, gravity, np.asarray(np.cross(line, gravity), np.float64)) for line in lines]
    return min(frames, key=lambda frame: _unevenness(*frame.coordinates(points)))


def _unevenness(across: Vector, flat: NDArray[np.float64]) -> float:
    """Logarithm of the curve's thickness plus the skew; slightly larger if the curve is shorter than wide."""
    chord, height, _ = _chord(flat)
    curve, near = _curve(chord, height)
    thickness = np.std((height - curve(chord))[near])
    skew = np.corrcoef(across, chord)[0, 1]
    return float(np.log(thickness**2 + (0.5 * NOISE_M) ** 2) + skew**2 + 0.1 * (np.std(across) > np.std(chord)))


def _chord(flat: NDArray[np.float64]) -> tuple[Vector, Vector, NDArray[np.float64]]:
    """Coordinates (n,) along and orthogonal to the principal axis of points (n, 2), and both axes (2, 2) as rows."""
    centered = flat - flat.mean(axis=0)
    axes = np.linalg.eigh(centered.T @ centered)[1].T[::-1]
    along, beside = axes @ centered.T
    return along, beside, axes


def _curve(along: Vector, beside: Vector) -> tuple[np.polynomial.Polynomial, NDArray[np.bool_]]:
    """A smooth curve through points, and its inliers (n,), which exclude mixed pixels."""
    near = np.ones(len(along), bool)
    curve = np.polynomial.Polynomial.fit(along, beside, 4)
    for _ in range(2):
        gap = np.abs(beside - curve(along))
        near = gap <= max(MAX_GAP * NOISE_M, MAX_GAP * 1.5 * float(np.median(gap)))
        curve = np.polynomial.Polynomial.fit(along[near], beside[near], 4)
    return curve, near


def first_guess(flat: NDArray[np.float64], towards_gripper: Vector) -> FittedElastica:
    """Initial guess: the best of several shapes of approximately the right length, position and direction."""
    along, beside, axes = _chord(flat)
    curve, near = _curve(along, beside)
    low, high = (float(np.quantile(along[near], share)) for share in (0.02, 0.98))
    chord = np.linspace(low, high, 50)
    chord = chord[::-1] if axes[0] @ towards_gripper > 0 else chord
    nodes = flat.mean(axis=0) + np.stack([chord, curve(chord)], axis=-1) @ axes
    steps = np.diff(nodes, axis=0)
    length = float(np.linalg.norm(steps, axis=1).sum())
    end = float(np.arctan2(*steps[-1, ::-1]))
    candidates = [
        FittedElastica(end + np.deg2rad(turn), load, nodes.mean(axis=0), length)
        for turn in (-60, -40, -20, 0, 20, 40, 60)
        for load in (0.1, 1.0, 3.0, 10.0, 30.0, 100.0)
    ]
    return min(
        candidates, key=lambda candidate: float(np.mean(np.minimum(np.abs(candidate.unroll(flat)[1]), 10 * NOISE_M)))
    )


def fit(elastica: FittedElastica, flat: NDArray[np.float64]) -> FittedElastica:
    """The elastica of the same length with the smallest distance to points (n, 2), without sliding along itself."""
    bounds = ([-np.inf, -np.inf, np.log(LOADS[0] / elastica.load)], [np.inf, np.inf, np.log(LOADS[1] / elastica.load)])
    found = scipy.optimize.least_squares(
        lambda p: _changed(elastica, p).unroll(flat)[1] / NOISE_M,
        np.clip(np.zeros(3), *bounds),
        bounds=bounds,
        loss="soft_l1",
        x_scale=(0.01, 0.1, 1.0),
    )
    return _changed(elastica, found.x)


def load_deviation(elastica: FittedElastica, flat: NDArray[np.float64]) -> float:
    """Standard deviation of the logarithm of a fitted elastica's load, from the scatter of its points (n, 2)."""
    steps = STEP * np.eye(3)
    ahead, back = ([_changed(elastica, sign * step).unroll(flat)[1] for step in steps] for sign in (1, -1))
    jacobian = (np.array(ahead) - np.array(back)) / (2 * STEP)
    scatter = 1.4826 * np.median(np.abs(elastica.unroll(flat)[1]))  # robust σ from the MAD
    return float(scatter * np.sqrt(np.linalg.inv(jacobian @ jacobian.T)[2, 2]))


def _changed(elastica: FittedElastica, by: NDArray[np.float64]) -> FittedElastica:
    """Shifted normal to its chord [m], with another inclination at the free end [rad] and logarithm of the load."""
    chord = elastica.nodes[-1] - elastica.nodes[0]
    beside = np.array([-chord[1], chord[0]]) / np.linalg.norm(chord)
    return FittedElastica(
        elastica.tip + by[1], elastica.load * float(np.exp(by[2])), elastica.middle + by[0] * beside, elastica.length
    )
