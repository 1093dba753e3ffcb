"""Lenses, projection and distances of one vertex (eqs. 10, 11, 20)."""

import numpy as np

from calib.camera import Camera


def distort(x: float, y: float, coefficients: np.ndarray) -> tuple[float, float]:
    """Brown–Conrady with rational part: normalised coordinates (x, y) as the lens bends them."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    r2 = x**2 + y**2
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2), y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y


def distort_fisheye(x: float, y: float, coefficients: np.ndarray) -> tuple[float, float]:
    """Kannala–Brandt: a point at the angle θ from the axis is θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) from the centre."""
    r = np.hypot(x, y)
    theta = np.arctan2(r, 1.0)
    bent = theta + sum(k * theta ** (3 + 2 * i) for i, k in enumerate(coefficients))
    return (x, y) if r == 0 else (x / r * bent, y / r * bent)


def bend(camera: Camera, x: float, y: float) -> np.ndarray:
    """D_s in normalised coordinates (2,)."""
    formula = {"brown_conrady": distort, "fisheye": distort_fisheye}[camera.lens.name]
    return np.array(formula(x, y, camera.lens.coefficients))


def project(camera: Camera, vertex: np.ndarray) -> np.ndarray:
    """P_s(v) = D_s(K_s R_s (v − c_s) / (R_s (v − c_s))_z) (10); NaN where the vertex is not before the camera."""
    x, y, z = camera.T_rs[:3, :3].T @ (vertex - camera.T_rs[:3, 3])
    if z <= 0:
        return np.full(2, np.nan)
    u, v = bend(camera, x / z, y / z)
    return np.array([camera.fx * u + camera.cx, camera.fy * v + camera.cy])


def distance(camera: Camera, vertex: np.ndarray) -> float:
    """d = ‖c_s − v‖₂ (11)."""
    return float(np.sqrt(np.sum((camera.T_rs[:3, 3] - vertex) ** 2)))


def distance_at_center(camera: Camera, vertex: np.ndarray, normal: np.ndarray) -> float:
    """d of where the line of sight of the pixel's centre meets the plane through a vertex, in lines of sight (u, w, 1).

    A plane that is seen at a cosine below 0.2 is turned to that; what no pixel sees is as far as it is. The way to the
    centre is that in the image; only a fisheye bends it enough to count.
    """
    pixel = seen_pixel(camera, vertex, normal)
    if pixel is None:
        return distance(camera, vertex)
    R_sr = camera.T_rs[:3, :3].T
    x, y, z = R_sr @ (vertex - camera.T_rs[:3, 3])
    column, row = project(camera, vertex)
    aside = np.array([(pixel[1] - column) / camera.fx, (pixel[0] - row) / camera.fy, 0.0])
    if camera.lens.name == "fisheye":
        steps = [
            bend(camera, x / z + du, y / z + dw) - bend(camera, x / z - du, y / z - dw) for du, dw in 1e-5 * np.eye(2)
        ]
        aside[:2] = np.linalg.solve(np.array(steps).T / 2e-5, aside[:2])
    sight = np.array([x / z, y / z, 1.0]) + aside
    length = np.linalg.norm(sight)
    n = R_sr @ normal
    return float(z * length * (1 - n @ aside / min(n @ sight, -0.2 * length)))


def seen_pixel(camera: Camera, vertex: np.ndarray, normal: np.ndarray) -> tuple[int, int] | None:
    """Row and column of p = ⌊P_s(v) + (½, ½)⌋ (20); None outside the image, behind the camera or facing away."""
    column, row = np.floor(project(camera, vertex) + 0.5)
    facing = normal @ (vertex - camera.T_rs[:3, 3]) < 0
    if not (facing and 0 <= column < camera.width and 0 <= row < camera.height):
        return None
    return int(row), int(column)
