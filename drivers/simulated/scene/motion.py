"""Motion and bending of simulated surfaces: smooth, random, at rest for the first second."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose


def smooth_step(x: float) -> float:
    """Smooth step from 0 at x ≤ 0 to 1 at x ≥ 1, with continuous first and second derivative."""
    x = np.clip(x, 0.0, 1.0)
    return float(x**3 * (10 - 15 * x + 6 * x**2))


@dataclass(frozen=True)
class Placement:
    """Pose and bend of a surface at one moment.

    The surface is a flat rectangle rolled onto a cylinder: an isometry for all values.

    Attributes:
        T_rp: pose that maps the plane of the unbent sheet (x right, y down, z away from the viewer) to the rig [m].
        curvature: of the cylinder [1/m]; positive bends the ends away from the viewer, zero is flat.
        direction: angle of the bending direction in the sheet, from its x axis [rad].
        offset: position along that direction at which the cylinder touches the plane, from the sheet's centre [m].
    """

    T_rp: Pose
    curvature: float = 0.0
    direction: float = 0.0
    offset: float = 0.0

    @property
    def T_rb(self) -> Pose:
        """Pose that maps the bend frame to the rig: origin on the contact line, x along the bending direction."""
        T_pb = pose.from_rotation_vector((0, 0, self.direction), (0, 0, 0))
        T_pb[:3, 3] = T_pb[:3, 0] * self.offset
        return self.T_rp @ T_pb


@dataclass(frozen=True)
class Oscillation:
    """Nine smooth random signals in [-1, 1], each a sum of two sinusoids of incommensurable frequencies.

    They are 0 for the first `hold_s` seconds, so that a tracker can detect the object at rest, and reach their full
    amplitude within `ramp_s`.

    Attributes:
        seed: random seed of phases and frequencies.
        speed: factor on all frequencies; with 0 the signals stay 0.
        hold_s, ramp_s: duration of the rest and of the ramp [s].
    """

    seed: int
    speed: float = 1.0
    hold_s: float = 1.0
    ramp_s: float = 3.0

    def at(self, t: float) -> NDArray[np.float64]:
        """The signals (9,) at time `t` [s] after the start."""
        frequencies, phases = self._sinusoids
        return self._envelope(t) * (np.array([0.7, 0.3]) @ np.sin(frequencies * t + phases))

    def _envelope(self, t: float) -> float:
        return smooth_step((t - self.hold_s) / self.ramp_s) if self.speed > 0 else 0.0

    @cached_property
    def _sinusoids(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angular frequencies [rad/s] and phases [rad] of the slow and the fast sinusoids, (2, 9) each."""
        generator = np.random.default_rng([self.seed, 2])
        frequencies = generator.uniform([[0.14], [0.27]], [[0.23], [0.40]], (2, 9))
        return 2 * np.pi * self.speed * frequencies, generator.uniform(0, 2 * np.pi, (2, 9))


@dataclass(frozen=True)
class Motion:
    """Random oscillation about a rest pose.

    Attributes:
        seed: random seed of the oscillation and of the bending direction.
        rest: translation at rest [m], shape (3,); the sheet then faces the rig's origin.
        translation: maximum displacement along x, y, z [m].
        rotation: maximum rotation about x, y, z [rad].
        bend: maximum angle between the normals at both ends of the sheet along the bending direction [rad].
        width, height: of the sheet [m].
        turn: maximum change of the bending direction [rad].
        shift: maximum distance of the contact line from the centre [m].
        speed: factor on all frequencies; with 0 the surface is static.
    """

    seed: int
    rest: tuple[float, float, float]
    translation: tuple[float, float, float]
    rotation: tuple[float, float, float]
    bend: float
    width: float
    height: float
    turn: float
    shift: float
    speed: float = 1.0

    def at(self, t: float) -> Placement:
        """The placement at time `t` [s] after the start."""
        channels = self._oscillation.at(t)  # translation, rotation, bend, direction, offset
        translation = np.asarray(self.rest) + np.asarray(self.translation) * channels[0:3]
        direction = float(self._first_direction + self.turn * channels[7])
        extent = np.hypot(self.width * np.cos(direction), self.height * np.sin(direction))
        return Placement(
            T_rp=pose.from_rotation_vector(np.asarray(self.rotation) * channels[3:6], translation),
            curvature=float(self.bend * channels[6] / extent),
            direction=direction,
            offset=float(self.shift * channels[8]),
        )

    @cached_property
    def _first_direction(self) -> float:
        return float(np.random.default_rng([self.seed, 1]).uniform(0, np.pi))

    @cached_property
    def _oscillation(self) -> Oscillation:
        return Oscillation(self.seed, self.speed)
