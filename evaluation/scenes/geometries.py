"""Ten ways in which a sheet bends, each a smooth motion, as control points of a spline surface over time.

A shape is given in the sheet's own coordinates, x to the right, y downwards, z away from the camera, as what becomes of
the flat sheet when it bends by the strength s, −1…1; s = 0 is flat. The control points are those whose surface comes
closest, and that surface is the truth. Most shapes are developable, as those of paper are; `dome` and `saddle` are not.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from evaluation.scenes.surfaces import SplineSurface

Array = NDArray[np.float64]

#: What becomes of flat coordinates x, y (rows, columns) at strength s: positions (rows, columns, 3), in the unit
#: of half the sheet's width; the sheet reaches to ±1 in x and ± `ASPECT` in y.
Shape = Callable[[Array, Array, float], Array]

#: Height over width of the sheet.
ASPECT = 0.75


@dataclass(frozen=True, slots=True)
class Motion:
    """Rigid motion of a sheet while it bends; the periods share no factor, so all combinations occur.

    Attributes:
        width: of the sheet [m].
        distance: of its centre at rest [m].
        bend_s: period of the bending [s].
        sway_s: period of the swaying [s].
        sway_m: how far its centre moves to every side [m].
        turn_rad: how far it turns about every axis.
    """

    width: float = 0.32
    distance: float = 0.85
    bend_s: float = 4.0
    sway_s: float = 6.7
    sway_m: float = 0.03
    turn_rad: float = 0.2


def _developed(heading: Callable[[Array], Array], along: Array) -> tuple[Array, Array]:
    """Curve of unit speed through the origin, whose angle to the x axis is given: x and z at places along it."""
    far = 1.5
    s = np.linspace(-far, far, 601)
    angle = heading(s)
    x, z = (cumulative_simpson(part, x=s, initial=0) for part in (np.cos(angle), np.sin(angle)))
    x0, z0 = np.interp(0.0, s, x), np.interp(0.0, s, z)
    return np.interp(along, s, x - x0), np.interp(along, s, z - z0)


def _bent(x: Array, y: Array, heading: Callable[[Array], Array], turned: float = 0.0) -> Array:
    """Bent along one direction, which is turned by an angle from the x axis."""
    c, s = np.cos(turned), np.sin(turned)
    along, across = c * x + s * y, c * y - s * x
    a, z = _developed(heading, along)
    return np.stack([c * a - s * across, s * a + c * across, z], axis=-1)


def _plane(x: Array, y: Array, s: float) -> Array:
    return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _cylinder(x: Array, y: Array, s: float) -> Array:
    return _bent(x, y, lambda a: 0.6 * s * a)


def _trough(x: Array, y: Array, s: float) -> Array:
    return _bent(x, y, lambda a: 0.8 * s * a, np.pi / 2)


def _diagonal(x: Array, y: Array, s: float) -> Array:
    return _bent(x, y, lambda a: 0.7 * s * a, np.deg2rad(35))


def _s_bend(x: Array, y: Array, s: float) -> Array:
    return _bent(x, y, lambda a: 0.45 * s * (1.5 * np.minimum(a**2, 1.2) - 0.5))


def _one_sided(x: Array, y: Array, s: float) -> Array:
    return _bent(x, y, lambda a: 0.55 * s * np.maximum(a + 0.2, 0) ** 2)


def _corner(x: Array, y: Array, s: float) -> Array:
    return _bent(x, y, lambda a: 0.8 * s * np.maximum(a - 0.1, 0), np.deg2rad(45))


def _twist(x: Array, y: Array, s: float) -> Array:
    angle = 0.25 * s * x
    return np.stack([x, y * np.cos(angle), y * np.sin(angle)], axis=-1)


def _dome(x: Array, y: Array, s: float) -> Array:
    return np.stack([x, y, 0.12 * s * np.cos(np.pi / 2 * x) * np.cos(np.pi / 2 * y / ASPECT)], axis=-1)


def _saddle(x: Array, y: Array, s: float) -> Array:
    return np.stack([x, y, 0.08 * s * (x**2 - y**2 / ASPECT**2)], axis=-1)


#: The shapes by name.
GEOMETRIES: Mapping[str, Shape] = {
    "plane": _plane,
    "cylinder": _cylinder,
    "trough": _trough,
    "diagonal": _diagonal,
    "s-bend": _s_bend,
    "one-sided": _one_sided,
    "corner": _corner,
    "twist": _twist,
    "dome": _dome,
    "saddle": _saddle,
}


class MovingSheet:
    """Control points of one geometry over time, in rig coordinates.

    Args:
        shape: what it does, one of `GEOMETRIES`.
        motion: how it moves.
        control_points: along its short side (u, downwards) and its long one (w, to the right).
        degree: of the spline.
        phase: turns (3,) 0…1 of the swaying that differ from sequence to sequence.
    """

    def __init__(
        self,
        shape: Shape,
        motion: Motion,
        phase: NDArray[np.floating],
        control_points: tuple[int, int] = (4, 4),
        degree: int = 2,
    ):
        self._shape = shape
        self._motion = motion
        self._phase = 2 * np.pi * np.asarray(phase)
        unit = np.linspace(0, 1, 41)
        self._spline = SplineSurface(control_points, degree, unit, unit)
        y, x = np.meshgrid(ASPECT * (2 * unit - 1), 2 * unit - 1, indexing="ij")
        self._flat = x, y

    def control(self, t: float) -> Array:
        """Control points (rows, columns, 3) [m] at time t [s]; at 0 the sheet is flat and faces the camera."""
        motion = self._motion
        strength = float(np.sin(2 * np.pi * t / motion.bend_s))
        shaped = self._spline.fit(self._shape(*self._flat, strength)) * motion.width / 2
        angle = 2 * np.pi * t / motion.sway_s
        # Differences of sines, so that all begins at rest, at zero.
        sway = (np.sin(angle * np.array([1.0, 1.3, 0.7]) + self._phase) - np.sin(self._phase)) / 2
        turn = Rotation.from_rotvec(motion.turn_rad * sway[[1, 2, 0]])
        place = motion.sway_m * sway + [0, 0, motion.distance]
        return turn.apply(shaped.reshape(-1, 3)).reshape(shaped.shape) + place
