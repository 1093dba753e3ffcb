"""How a simulated surface bends and moves: smooth, seeded, at rest for the first second."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose


def smooth_step(x: float) -> float:
    """From 0 at 0 and below to 1 at 1 and above, with continuous velocity and acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return float(x**3 * (10 - 15 * x + 6 * x**2))


@dataclass(frozen=True)
class Placement:
    """Where a surface is and how it is bent at one moment.

    The surface is a flat rectangle rolled onto a cylinder: isometric, whatever the numbers are.

    Attributes:
        T_rp: pose that maps the plane of the unbent sheet (x right, y down, z away from the viewer) to the rig [m].
        curvature: of the cylinder [1/m]; positive bends the ends away from the viewer, zero is flat.
        direction: angle of the direction that is bent, in the sheet, from its x axis [rad].
        offset: where along that direction the cylinder touches the plane, from the sheet's centre [m].
    """

    T_rp: Pose
    curvature: float = 0.0
    direction: float = 0.0
    offset: float = 0.0

    @property
    def T_rb(self) -> Pose:
        """Pose that maps the bend frame to the rig: origin where the cylinder touches, x along the bent direction."""
        T_pb = pose.from_rotation_vector((0, 0, self.direction), (0, 0, 0))
        T_pb[:3, 3] = T_pb[:3, 0] * self.offset
        return self.T_rp @ T_pb


@dataclass(frozen=True)
class Oscillation:
    """Nine numbers in [-1, 1] that change smoothly; each is a sum of two sinusoids of unrelated frequencies.

    They are 0 during the first `hold_s` seconds, so that a tracker can find what is at rest, and grow to their full
    size within `ramp_s`.

    Attributes:
        seed: of phases and frequencies.
        speed: factor on all frequencies; with 0 nothing ever moves.
        hold_s, ramp_s: duration of rest and of the growth [s].
    """

    seed: int
    speed: float = 1.0
    hold_s: float = 1.0
    ramp_s: float = 3.0

    def at(self, t: float) -> NDArray[np.float64]:
        """The numbers (9,) at time `t` [s] after the start."""
        frequencies, phases = self._sinusoids
        return self._envelope(t) * (np.array([0.7, 0.3]) @ np.sin(frequencies * t + phases))

    def _envelope(self, t: float) -> float:
        return smooth_step((t - self.hold_s) / self.ramp_s) if self.speed > 0 else 0.0

    @cached_property
    def _sinusoids(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angular frequencies [rad/s] and phases [rad] of the slow and the fast part, (2, 9) each."""
        generator = np.random.default_rng([self.seed, 2])
        frequencies = generator.uniform([[0.14], [0.27]], [[0.23], [0.40]], (2, 9))
        return 2 * np.pi * self.speed * frequencies, generator.uniform(0, 2 * np.pi, (2, 9))


@dataclass(frozen=True)
class Motion:
    """Oscillations about a rest pose.

    Attributes:
        seed: of the oscillation, and of the direction that is bent.
        rest: translation at rest [m], shape (3,); the sheet then faces the rig's origin.
        translation: largest displacement along x, y, z [m].
        rotation: largest rotation about x, y, z [rad].
        bend: largest angle between the normals at two ends of the sheet that lie along the bent direction [rad].
        width, height: of the sheet [m].
        turn: largest change of the bent direction [rad].
        shift: largest distance of the contact line from the centre [m].
        speed: factor on all frequencies; with 0 nothing ever moves.
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
