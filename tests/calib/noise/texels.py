"""Textures of the texels that `write_texture` writes, and what a likelihood kernel makes of them in plain NumPy."""

import numpy as np

from calib.noise.base import DepthNoise
from calib.noise.texture import WINDOW_M, write_texture


def render_texture(model: DepthNoise, distance: np.ndarray, amplitude: np.ndarray, uniform: float) -> np.ndarray:
    """The texture (height + 2, width + 2, 8) of a whole image; the uniform density where there is no return."""
    height, width = distance.shape
    texture = np.zeros((height + 2, width + 2, 8), np.float32)
    texture[..., 6] = uniform
    write_texture(model, distance, amplitude, (0, 0), texture)
    return texture


def negative_log_density(texels: np.ndarray, t: np.ndarray | list[float]) -> np.ndarray:
    """−log φ (n, m) from texels (n, 8) at t = y − x (m,), y the first number of a texel."""
    _, m0, m1, s0, s1, s2, n0, n1 = texels.astype(np.float64).T[:, :, None]
    t = np.asarray(t)
    inside = np.clip(t, -WINDOW_M, WINDOW_M)
    e = (t - m0 - m1 * inside) * (s0 + inside * (s1 + inside * s2))
    return 0.5 * e**2 + n0 + n1 * inside
