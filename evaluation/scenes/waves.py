"""A sheet in standing waves: isometric, with more detail than 4 × 4 control points can represent."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from calib import pose
from evaluation.scenes.exposure import LabeledExposure
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import Sheet, Wall
from evaluation.scenes.time_of_flight import SR4000, TimeOfFlight, frame_set

#: Points of the rendered grid, of the integrated profile, and stride of the ground truth on the grid.
_GRID, _PROFILE, _TRUTH_STEP = (241, 361), 2001, 6


@dataclass(frozen=True)
class Waves:
    """A sheet whose curvature is a standing wave along a direction oblique to its sides.

    Attributes:
        seed: of the noise.
        width, height: of the sheet [m].
        curvature: maximum [1/m].
        length: wavelength [m].
        period: of the wave [s].
        direction: of the curvature, measured from the long side [degrees].
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
        """Material points (rows, columns, 3) [m] at time `t` [s]; flat at 0, at full amplitude from 1.5 s on.

        The sheet stays on a generalised cylinder whose profile has the wave's curvature, so the motion is isometric.
        """
        turn = np.deg2rad(self.direction)
        y, x = np.meshgrid(
            np.linspace(-self.height / 2, self.height / 2, _GRID[0]),
            np.linspace(-self.width / 2, self.width / 2, _GRID[1]),
            indexing="ij",
        )
        along, across = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
        s = np.linspace(along.min(), along.max(), _PROFILE)
        amplitude = _smooth_step(t / 1.5) * np.cos(2 * np.pi * t / self.period)
        curvature = self.curvature * amplitude * np.cos(2 * np.pi * s / self.length)
        angle = cumulative_simpson(curvature, x=s, initial=0)
        angle -= np.interp(0, s, angle)
        forward, up = (cumulative_simpson(part, x=s, initial=0) for part in (np.cos(angle), np.sin(angle)))
        forward, up = (np.interp(along, s, part - np.interp(0, s, part)) for part in (forward, up))
        flat = np.cos(turn) * forward - np.sin(turn) * across, np.sin(turn) * forward + np.cos(turn) * across
        return pose.transform(self._pose(t), np.stack([*flat, up], axis=-1))

    def exposures(self, times: NDArray[np.floating], reflectivity: NDArray[np.floating]) -> list[LabeledExposure]:
        """Measurements of an SR4000 at some times [s].

        Args:
            times: of the exposures (n,) [s].
            reflectivity: infra-red reflectivity of the sheet's texture (h, w).
        """
        generator = np.random.default_rng([self.seed, 7])
        renderer, sensor = Renderer(SR4000, Wall(1.6)), TimeOfFlight()
        exposures = []
        for seq, t in enumerate(times):
            points = self.points(float(t))
            measured = sensor.measure(renderer.render(Sheet(points, reflectivity.astype(np.float64))), generator)
            frames = frame_set(measured, seq, round(float(t) * 1e9))
            exposures.append(LabeledExposure(frames, points[::_TRUTH_STEP, ::_TRUTH_STEP]))
        return exposures

    def _pose(self, t: float) -> pose.Pose:
        phase = _smooth_step(t / 1.5) * np.sin(2 * np.pi * np.array([0.31, 0.23, 0.17]) * t)
        turn = np.deg2rad([12, 14, 8]) * phase
        return pose.from_rotation_vector(turn, np.array([0.03, 0.02, 0.04]) * phase + (0, 0, self.distance))


def _smooth_step(x: float) -> float:
    """Smooth step from 0 at x ≤ 0 to 1 at x ≥ 1, with continuous velocity and acceleration."""
    x = np.clip(x, 0.0, 1.0)
    return float(x**3 * (10 - 15 * x + 6 * x**2))
