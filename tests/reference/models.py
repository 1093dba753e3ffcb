"""Deformation models, one vertex at a time (eqs. 2–8)."""

import numpy as np

from calib import pose


def knots(control_points: int, degree: int) -> np.ndarray:
    """Equidistant knots η in [0, 1], the first and the last repeated degree + 1 times."""
    spans = control_points - degree
    return np.array([0.0] * degree + [i / spans for i in range(spans + 1)] + [1.0] * degree)


def base_spline(i: int, d: int, u: float, eta: np.ndarray) -> float:
    """n_{i,d}(u) by Cox–de Boor (4, 5); 0/0 := 0, and the last span that is not empty includes its end."""
    if d == 0:
        closes = eta[i] < eta[i + 1] == eta[-1] and u == eta[-1]
        return 1.0 if eta[i] <= u < eta[i + 1] or closes else 0.0
    rise, fall = eta[i + d] - eta[i], eta[i + d + 1] - eta[i + 1]
    left = (u - eta[i]) / rise * base_spline(i, d - 1, u, eta) if rise > 0 else 0.0
    right = (eta[i + d + 1] - u) / fall * base_spline(i + 1, d - 1, u, eta) if fall > 0 else 0.0
    return left + right


def base_spline_slope(i: int, d: int, u: float, eta: np.ndarray) -> float:
    """Derivative of n_{i,d} at u, which is exact in terms of the splines of one degree less."""
    rise, fall = eta[i + d] - eta[i], eta[i + d + 1] - eta[i + 1]
    left = d / rise * base_spline(i, d - 1, u, eta) if rise > 0 else 0.0
    right = d / fall * base_spline(i + 1, d - 1, u, eta) if fall > 0 else 0.0
    return left - right


def rational_basis(u: float, w: float, degree: int, weights: np.ndarray) -> np.ndarray:
    """R_ij(u, w) for every control point (rows, columns) (3)."""
    rows, columns = weights.shape
    n_u = [base_spline(i, degree, u, knots(rows, degree)) for i in range(rows)]
    n_w = [base_spline(j, degree, w, knots(columns, degree)) for j in range(columns)]
    products = np.outer(n_u, n_w) * weights
    return products / products.sum()


def surface(u: float, w: float, control: np.ndarray, weights: np.ndarray, degree: int) -> np.ndarray:
    """N((u, w), Θ) for control points (rows, columns, 3) and their weights (rows, columns) (2)."""
    basis = rational_basis(u, w, degree, weights)
    return np.einsum("ij,ijk->k", basis, control)


def surface_normal(u: float, w: float, control: np.ndarray, weights: np.ndarray, degree: int) -> np.ndarray:
    """N̂ = ∂u × ∂w / ‖∂u × ∂w‖; with N = A/W, ∂N is the quotient rule's (∂A − N ∂W)/W, whose W cancels here."""
    rows, columns = weights.shape
    eta_u, eta_w = knots(rows, degree), knots(columns, degree)
    n_u = [base_spline(i, degree, u, eta_u) for i in range(rows)]
    n_w = [base_spline(j, degree, w, eta_w) for j in range(columns)]
    d_u = [base_spline_slope(i, degree, u, eta_u) for i in range(rows)]
    d_w = [base_spline_slope(j, degree, w, eta_w) for j in range(columns)]
    arms = control - surface(u, w, control, weights, degree)
    along_u = np.einsum("i,j,ij,ijk->k", d_u, n_w, weights, arms)
    along_w = np.einsum("i,j,ij,ijk->k", n_u, d_w, weights, arms)
    normal = np.cross(along_u, along_w)
    return normal / np.linalg.norm(normal)


def deform(u: float, w: float, offset: float, control: np.ndarray, weights: np.ndarray, degree: int) -> np.ndarray:
    """D_Θ(v) = N((u, w), Θ) + N̂((u, w), Θ) · o (8)."""
    return surface(u, w, control, weights, degree) + surface_normal(u, w, control, weights, degree) * offset


def gravity_segment(points: np.ndarray, s: np.ndarray, beta: float, length: float) -> np.ndarray:
    """Eq. 9 for one segment that begins at x = 0; points (n, 3) whose place on the flat strip is s (n,)."""
    if beta == 0:
        return points
    x, y, z = points.T
    r, x_c = length / beta, np.clip(s, 0, length)
    a = x_c / r
    return np.column_stack(
        [(x - x_c) * np.cos(a) - (z - r) * np.sin(a), y, (z - r) * np.cos(a) + (x - x_c) * np.sin(a) + r]
    )


def gravity(flat: np.ndarray, angles: np.ndarray, total: float) -> np.ndarray:
    """Segments of a strip of the length `total`, from the far one back to the clamp, each carrying its tail along."""
    step, points = total / len(angles), flat
    for i in reversed(range(len(angles))):
        shift = np.array([i * step, 0, 0])
        moved = gravity_segment(points - shift, flat[:, 0] - shift[0], angles[i], step) + shift
        points = np.where(flat[:, :1] < shift[0], points, moved)
    return points


def flexpad(theta: np.ndarray, place: np.ndarray, T_rp: np.ndarray, half: float, minimum_radius: float) -> np.ndarray:
    """A sheet's point at `place` = (x, y): bends of eight sides add up, height map z + g z²/half, then the pose."""
    flat, height = np.array(place, float), 0.0
    for k in range(8):
        angle = np.deg2rad(45.0 * (k // 2))
        side = np.array([np.cos(angle), np.sin(angle)]) * (1 if k % 2 == 0 else -1)
        q, kappa = max(side @ place, 0.0), min(max(theta[k], -2.0), 2.0) / (2 * minimum_radius)
        if kappa != 0:
            flat += (np.sin(kappa * q) / kappa - q) * side
            height += (1 - np.cos(kappa * q)) / kappa
    height += min(max(theta[8], -0.5), 0.5) * height**2 / half
    turn = pose.from_rotation_vector(theta[9:12], (0, 0, 0))[:3, :3]
    return turn @ T_rp[:3, :3] @ np.array([*flat, -height]) + T_rp[:3, 3] + theta[12:15]


def flexpad_normal(
    theta: np.ndarray, place: np.ndarray, T_rp: np.ndarray, half: float, minimum_radius: float
) -> np.ndarray:
    """Unit normal towards the sensor, from numerical tangents."""
    step = 1e-6 * np.eye(2)
    ahead, behind = (
        [flexpad(theta, place + sign * along, T_rp, half, minimum_radius) for along in step] for sign in (1, -1)
    )
    normal = np.cross(ahead[1] - behind[1], ahead[0] - behind[0])
    return normal / np.linalg.norm(normal)
