"""What a likelihood kernel makes of the texels that `render_texture` writes, as plain NumPy."""

import numpy as np

from calib.noise.base import WINDOW_M


def negative_log_density(texels: np.ndarray, t: np.ndarray | list[float]) -> np.ndarray:
    """−log φ (n, m) from texels (n, 8) at t = y − x (m,), y the first number of a texel."""
    _, m0, m1, s0, s1, s2, n0, n1 = texels.astype(np.float64).T[:, :, None]
    t = np.asarray(t)
    inside = np.clip(t, -WINDOW_M, WINDOW_M)
    e = (t - m0 - m1 * inside) * (s0 + inside * (s1 + inside * s2))
    return 0.5 * e**2 + n0 + n1 * inside
