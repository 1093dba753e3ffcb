"""Analytic images of a sheet that bends about a vertical axis before a wall."""

from dataclasses import dataclass

import numpy as np

import abs_service as a

CAMERA = a.Camera(160, 120, fx=200, fy=200, cx=79.5, cy=59.5)
#: Standard deviation of rendered depths [m], and the noise model that describes it.
SIGMA_M = 0.001
NOISE = a.noise.Constant(SIGMA_M)


@dataclass(frozen=True)
class Sheet:
    """A sheet of width × height [m] at z = `away` whose sides bend backwards.

    Attributes:
        curvature: inverse radius [1/m].
        right: shift along x [m].
    """

    curvature: float = 0.0
    right: float = 0.0
    width: float = 0.28
    height: float = 0.20
    away: float = 0.6

    def material(self, flat):
        """Positions (n, 3) [m] of points (n, 3) of the flat sheet at right = 0."""
        along = np.asarray(flat)[:, 0]
        angle = self.curvature * along
        x = along * np.sinc(angle / np.pi)
        z = self.away + 0.5 * self.curvature * along**2 * np.sinc(angle / 2 / np.pi) ** 2
        return np.stack([x + self.right, flat[:, 1], z], axis=1)

    def seen(self, camera):
        """Distance along each ray [m] and material coordinates (height, width, 2) [m]; NaN beside the sheet."""
        directions = camera.rays() @ camera.T_rs[:3, :3].T
        ox, oz = camera.center[0] - self.right, camera.center[2] - self.away
        dx, dz, k = directions[..., 0], directions[..., 2], self.curvature
        # k (x² + z²) / 2 = z on the cylinder through the origin: a quadratic in the distance that has a plane as limit.
        square, linear, constant = k / 2 * (dx**2 + dz**2), k * (ox * dx + oz * dz) - dz, k / 2 * (ox**2 + oz**2) - oz
        with np.errstate(invalid="ignore"):
            distance = 2 * constant / (-linear + np.sqrt(linear**2 - 4 * square * constant))
        x, y = ox + distance * dx, camera.center[1] + distance * directions[..., 1]
        z = oz + distance * dz
        along = np.arctan2(k * x, 1 - k * z) / k if k else x
        on = (np.abs(along) < self.width / 2) & (np.abs(y) < self.height / 2)
        material = np.stack([along, y], axis=-1)
        return np.where(on, distance, np.nan), np.where(on[..., None], material, np.nan)

    def depth(self, camera=CAMERA, seed=0, geometry="z", wall=1.2):
        """Noisy depth image [m], radial or z, float64; the wall is a plane."""
        rays = camera.rays()
        distance = self.seen(camera)[0]
        distance = np.where(np.isfinite(distance), distance, wall / rays[..., 2])
        distance = distance + np.random.default_rng(seed).normal(0, SIGMA_M, distance.shape)
        return distance * rays[..., 2] if geometry == "z" else distance

    def image(self, camera):
        """A smooth pattern on the sheet as a colour image."""
        along, y = np.moveaxis(self.seen(camera)[1], -1, 0)
        grey = 128 + 50 * np.sin(along / 0.008) + 50 * np.sin(y / 0.010)
        return np.repeat(np.where(np.isfinite(grey), grey, 20).astype(np.uint8)[..., None], 3, axis=2)
