"""The scenes there are: a sheet that bends, a flat board, each before a textured wall."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.motion import Motion, Placement
from drivers.simulated.surface import surface_points
from drivers.simulated.texture import Texture, checkerboard, smooth_pattern

#: Distance of the sheet at rest, and of the wall behind it, along the rig's z axis [m].
REST_Z, WALL_Z = 1.0, 1.6

#: What the wall's texture covers [m]; beyond it the wall has the colour of the texture's edge.
_WALL = (4.0, 3.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """A moving rectangle and the wall z = `WALL_Z` behind it.

    Attributes:
        width, height: of the rectangle [m].
        motion: of the rectangle.
        texture: of the rectangle.
        wall: texture of the wall, centred on the rig's z axis.
    """

    width: float
    height: float
    motion: Motion
    texture: Texture
    wall: Texture

    def grid(self, placement: Placement, rows: int, columns: int) -> NDArray[np.float64]:
        """Rig coordinates (rows, columns, 3) [m] of a regular grid of material points that reaches the rims."""
        a = np.linspace(-self.width / 2, self.width / 2, columns)
        b = np.linspace(-self.height / 2, self.height / 2, rows)
        return surface_points(placement, *np.meshgrid(a, b))


def sheet(seed: int, bend: float, speed: float) -> Scene:
    """A sheet of 0.30 × 0.20 m that bends by up to `bend` [rad] while it moves and turns."""
    width, height = 0.30, 0.20
    motion = Motion(
        seed=seed,
        rest=(0.0, 0.0, REST_Z),
        translation=(0.04, 0.03, 0.05),
        rotation=(np.deg2rad(13), np.deg2rad(13), np.deg2rad(10)),
        bend=bend,
        width=width,
        height=height,
        turn=np.deg2rad(35),
        shift=0.02,
        speed=speed,
    )
    pattern = smooth_pattern(seed, width, height, (0.025, 0.01, 0.004), 800.0, color=(0.1, 0.95), infrared=(0.35, 0.9))
    return Scene(width, height, motion, pattern, _wall(seed))


def board(seed: int, bend: float, speed: float) -> Scene:
    """A rigid checker board of 0.30 × 0.20 m, squares of 50 mm, that moves and turns; nothing bends it."""
    width, height = 0.30, 0.20
    motion = Motion(
        seed=seed,
        rest=(0.0, 0.0, REST_Z),
        translation=(0.06, 0.05, 0.08),
        rotation=(np.deg2rad(20), np.deg2rad(20), np.deg2rad(15)),
        bend=0.0,
        width=width,
        height=height,
        turn=0.0,
        shift=0.0,
        speed=speed,
    )
    return Scene(width, height, motion, checkerboard(width, height, 0.05), _wall(seed))


def _wall(seed: int) -> Texture:
    """Paler than the sheet, and so dark in places that a time-of-flight sensor gets no return."""
    return smooth_pattern(seed + 1, *_WALL, (0.2, 0.05), 100.0, color=(0.3, 0.6), infrared=(0.12, 0.7))
