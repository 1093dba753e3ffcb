"""A sheet in standing waves: isometric, and richer than 4 × 4 control points can follow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from calib import pose
from drivers.simulated.scene.motion import smooth_step
from drivers.simulated.scene.texture import smooth_pattern
from evaluation.experiments.tracked import Shot
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import Sheet, Wall
from evaluation.scenes.time_of_flight import SR4000, TimeOfFlight, frame_set

#: Points of the rendered grid, of the profile that is integrated, and of the truth that estimates are compared with.
_GRID, _PROFILE, _TRUTH_STEP = (241, 361), 2001, 6


@dataclass(frozen=True)
class Waves:
    """A sheet whose curvature is a standing wave along a direction that is not one of its sides.

    Attributes:
        seed: of print and noise.
        width, height: of the sheet [m].
        curvature: largest [1/m].
        length: of a wave [m].
        period: of the wave [s].
        direction: along which it bends, from the long side [degrees].
        distance: of the sheet's centre [m].
    """

    seed: int
    width: float = 0.30
    height: float = 0.20
    curvature: float = 12.0
    length: float = 0.25
    period: float = 2.0
    direction: float = 20.0
    distance: float = 0.9

    def points(self, t: float) -> NDArray[np.float64]:
        """Material points (rows, columns, 3) [m] at time `t` [s]; flat at 0, and in full motion from 1.5 s on.

        The sheet stays on a cylinder whose profile has the wave's curvature, so that no length changes.
        """
        turn = np.deg2rad(self.direction)
        y, x = np.meshgrid(
            np.linspace(-self.height / 2, self.height / 2, _GRID[0]),
            np.linspace(-self.width / 2, self.width / 2, _GRID[1]),
            indexing="ij",
        )
        along, across = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
        s = np.linspace(along.min(), along.max(), _PROFILE)
        swing = self._ramp(t) * np.cos(2 * np.pi * t / self.period)
        curvature = self.curvature * swing * np.cos(2 * np.pi * s / self.length)
        angle = cumulative_simpson(curvature, x=s, initial=0)
        angle -= np.interp(0, s, angle)
        forward, up = (cumulative_simpson(part, x=s, initial=0) for part in (np.cos(angle), np.sin(angle)))
        forward, up = (np.interp(along, s, part - np.interp(0, s, part)) for part in (forward, up))
        flat = np.cos(turn) * forward - np.sin(turn) * across, np.sin(turn) * forward + np.cos(turn) * across
        return pose.transform(self._pose(t), np.stack([*flat, up], axis=-1))

    def shots(self, times: NDArray[np.floating]) -> list[Shot]:
        """What an SR4000 delivers at some moments [s], rendered by the experiments' own splatting."""
        generator = np.random.default_rng([self.seed, 7])
        pattern = smooth_pattern(
            self.seed, self.width, self.height, (0.02, 0.01), 400.0, (0.1, 0.95), (0.3, 0.9)
        ).texels[..., 3]
        renderer, sensor = Renderer(SR4000, Wall(1.6)), TimeOfFlight()
        shots = []
        for seq, t in enumerate(times):
            points = self.points(float(t))
            measured = sensor.measure(renderer.render(Sheet(points, pattern.astype(np.float64))), generator)
            images = frame_set(measured, seq, round(float(t) * 1e9))
            shots.append(Shot(images, points[::_TRUTH_STEP, ::_TRUTH_STEP]))
        return shots

    def _ramp(self, t: float) -> float:
        return smooth_step(t / 1.5)

    def _pose(self, t: float) -> pose.Pose:
        swing = self._ramp(t) * np.sin(2 * np.pi * np.array([0.31, 0.23, 0.17]) * t)
        turn = np.deg2rad([12, 14, 8]) * swing
        return pose.from_rotation_vector(turn, np.array([0.03, 0.02, 0.04]) * swing + (0, 0, self.distance))
