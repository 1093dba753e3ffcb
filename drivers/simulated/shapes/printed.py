"""Simulated calibration boards: their texture and ground-truth pose."""

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import gaussian_filter

from calib.board.artwork import rasterize
from calib.board.target import Charuco, Chessboard, Circles, Target
from calib.pose import Pose
from drivers.simulated.scene.body import Surface
from drivers.simulated.scene.texture import Texture

#: Boards by their name in an address; all about 0.36 × 0.24 m.
TARGETS: Mapping[str, Target] = {
    "chessboard": Chessboard(8, 5, 0.04),
    "charuco": Charuco(9, 6, 0.04, 0.03, "4x4_50"),
    "circles": Circles(8, 5, 0.04, 0.02),
}

#: Texels per metre, and σ of the blur [m] that models lenses, since heads sample points, not areas.
_DENSITY, _BLUR = 2000.0, 0.0012
#: Reflectivities of ink and paper in all channels: black ink is not black in infra-red.
_INK, _PAPER = 0.15, 0.85


def print_texture(target: Target) -> Texture:
    """Texture of a board with its white margin, centred on the paper."""
    white = gaussian_filter(rasterize(target, _DENSITY)[0], _BLUR * _DENSITY, mode="nearest")
    texels = np.repeat((_INK + (_PAPER - _INK) * white)[..., None], 4, axis=-1)
    return Texture(texels.astype(np.float32), _DENSITY)


def paper_size(target: Target) -> tuple[float, float]:
    """Width and height of the paper [m]."""
    rows, columns = rasterize(target, _DENSITY)[0].shape
    return columns / _DENSITY, rows / _DENSITY


def board_pose(surface: Surface, target: Target, t: float) -> Pose:
    """Ground-truth pose `T_rb` of a board at time `t` [s]: its frame b is that of `calib.board.views`, r is the rig.

    Args:
        surface: of the scene `target`: `parse(uri).build().scene.surfaces[0]`.
        target: its pattern, one of `TARGETS`.
        t: time since the first exposure [s]; exposure k is at k divided by the rate.
    """
    corners = surface.at(t).grid(2, 2)
    along, down = corners[0, 1] - corners[0, 0], corners[1, 0] - corners[0, 0]
    x, y = along / np.linalg.norm(along), down / np.linalg.norm(down)
    T_rb = np.eye(4)
    T_rb[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    T_rb[:3, 3] = corners.mean(axis=(0, 1)) - T_rb[:3, :3] @ target.points().mean(axis=0)
    return T_rb
