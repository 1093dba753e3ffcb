"""The equations of the method as plain, slow NumPy: one vertex at a time, as the paper writes them.

Numbers in parentheses are the paper's equations. The service uses nothing of this; tests compare the two.
"""

import numpy as np

from calib import pose
from calib.camera import Camera
from calib.noise.base import DepthNoise
from calib.noise.bayer import GaussianBayer
from calib.noise.grey import GaussianGrey
from calib.noise.intensity import GaussianIntensity

#: Noise of one number per pixel.
ChannelNoise = GaussianGrey | GaussianBayer | GaussianIntensity


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


def flexpad(theta: np.ndarray, place: np.ndarray, T_rp: np.ndarray, half: float, least_radius: float) -> np.ndarray:
    """A sheet's point at `place` = (x, y): bends of eight sides add up, height map z + g z²/half, then the pose."""
    flat, height = np.array(place, float), 0.0
    for k in range(8):
        angle = np.deg2rad(45.0 * (k // 2))
        side = np.array([np.cos(angle), np.sin(angle)]) * (1 if k % 2 == 0 else -1)
        q, kappa = max(side @ place, 0.0), min(max(theta[k], -2.0), 2.0) / (2 * least_radius)
        if kappa != 0:
            flat += (np.sin(kappa * q) / kappa - q) * side
            height += (1 - np.cos(kappa * q)) / kappa
    height += min(max(theta[8], -0.5), 0.5) * height**2 / half
    turn = pose.from_rotation_vector(theta[9:12], (0, 0, 0))[:3, :3]
    return turn @ T_rp[:3, :3] @ np.array([*flat, -height]) + T_rp[:3, 3] + theta[12:15]


def flexpad_normal(
    theta: np.ndarray, place: np.ndarray, T_rp: np.ndarray, half: float, least_radius: float
) -> np.ndarray:
    """Unit normal towards the sensor, from numerical tangents."""
    step = 1e-6 * np.eye(2)
    ahead, behind = (
        [flexpad(theta, place + sign * along, T_rp, half, least_radius) for along in step] for sign in (1, -1)
    )
    normal = np.cross(ahead[1] - behind[1], ahead[0] - behind[0])
    return normal / np.linalg.norm(normal)


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


def depth_cost(  # one argument per symbol
    camera: Camera,
    noise: DepthNoise,
    image: np.ndarray,
    amplitude: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    outlier_share: float,
    range_m: float,
) -> float:
    """−Σ_v log φ (17–19), where φ is the larger of (1 − ε) times the Gaussian and ε times the uniform density.

    A vertex that is not seen, or is seen by a pixel without a return, has the uniform density in the Gaussian's place.
    """
    total = 0.0
    for vertex, normal in zip(vertices, normals):
        pixel = seen_pixel(camera, vertex, normal)
        density = 1 / range_m
        if pixel is not None and np.isfinite(image[pixel]):
            x, a = np.array([distance_at_center(camera, vertex, normal)]), np.array([float(amplitude[pixel])])
            p = (np.array([pixel[0]]), np.array([pixel[1]]))
            sigma = noise.deviation(x, a, p)[0]
            e = (image[pixel] - x[0] - noise.mean(x, a, p)[0]) / sigma
            density = np.exp(-0.5 * e**2) / (np.sqrt(2 * np.pi) * sigma)
        total -= np.log(max((1 - outlier_share) * density, outlier_share / range_m))
    return float(total)


def color_cost(
    camera: Camera,
    sigma: float | np.ndarray,
    image: np.ndarray,
    colors: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    outlier_share: float,
) -> float:
    """−Σ_v log of the density of the measured colour given the vertex's; uniform where one of them is unknown.

    The deviation σ is one, or one of every vertex and channel (n, 3).
    """
    total, uniform = 0.0, 256.0**-3
    for vertex, normal, color, own in zip(vertices, normals, colors, np.broadcast_to(sigma, colors.shape)):
        pixel = seen_pixel(camera, vertex, normal)
        density = uniform
        if pixel is not None and np.all(np.isfinite(color)):
            e = (image[pixel].astype(float) - color) / own
            density = np.exp(-0.5 * e @ e) / np.prod(np.sqrt(2 * np.pi) * own)
        total -= np.log(max((1 - outlier_share) * density, outlier_share * uniform))
    return float(total)


def picture_deviation(noise: ChannelNoise, values: np.ndarray | float) -> np.ndarray:
    """σ of numbers of a picture that have these values."""
    relative = noise.relative if isinstance(noise, GaussianIntensity) else 0.0
    return np.sqrt(noise.sigma**2 + (relative * np.asarray(values)) ** 2)


def channel_cost(  # one argument per symbol
    camera: Camera,
    noise: ChannelNoise,
    image: np.ndarray,
    channel: np.ndarray,
    covered: np.ndarray,
    looks: np.ndarray,
    vertices: np.ndarray,
    normals: np.ndarray,
    outlier_share: float,
    widening: np.ndarray | float = 1.0,
) -> float:
    """−Σ_v log of the density of the measured number given the vertex's own in the channel that its pixel has.

    Uniform where one of them is unknown; where something covers the object, what an agreeing number costs on average.
    The deviation is that of the measured number, widened for every vertex and channel (n, channels).
    """
    total, uniform = 0.0, np.exp(-noise.uniform)
    for vertex, normal, look, wider in zip(vertices, normals, looks, np.broadcast_to(widening, looks.shape)):
        pixel = seen_pixel(camera, vertex, normal)
        density = uniform
        if pixel is not None and np.isfinite(image[pixel]) and np.isfinite(look[channel[pixel]]):
            sigma = picture_deviation(noise, float(image[pixel])) * wider[channel[pixel]]
            if covered[pixel]:
                total += 0.5 + np.log(np.sqrt(2 * np.pi) * sigma) - np.log(1 - outlier_share)
                continue
            e = (float(image[pixel]) - look[channel[pixel]]) / sigma
            density = np.exp(-0.5 * e**2) / (np.sqrt(2 * np.pi) * sigma)
        total -= np.log(max((1 - outlier_share) * density, outlier_share * uniform))
    return float(total)


def lambert(vertex: np.ndarray, normal: np.ndarray, lamp: np.ndarray) -> float:
    """Cosine of incidence over squared distance; 0 where the vertex faces away from the lamp."""
    d = float(np.linalg.norm(lamp - vertex))
    return max(float(normal @ (lamp - vertex)) / d, 0.0) / d**2


def meeting_point(begin: np.ndarray, end: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """(s, t, q) of begin + q (end − begin) = a + s (b − a) + t (c − a), for a triangle (3, 3) of a, b, c."""
    a, b, c = triangle
    return np.linalg.solve(np.column_stack([b - a, c - a, begin - end]), begin - a)


def stretch_cost(rest: np.ndarray, vertices: np.ndarray, edges: np.ndarray, deviation: float) -> float:
    """½ Σ (relative change of length / deviation)² over the edges."""
    total = 0.0
    for i, j in edges:
        before, now = np.linalg.norm(rest[i] - rest[j]), np.linalg.norm(vertices[i] - vertices[j])
        total += 0.5 * ((now / before - 1) / deviation) ** 2
    return float(total)


def warped(
    source: Camera, view: Camera, distance: np.ndarray, sigma: np.ndarray, largest_step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a view sees of the faces between neighbouring pixels, each a plane that the view's rays meet.

    Returns:
        Radial distances, their deviations, and by which share of a face's corners a pixel is near to any face's edge.
    """
    height, width = distance.shape
    points, origin = source.unproject(distance), view.center
    rays, own_rays = view.rays() @ view.T_rs[:3, :3].T, source.rays() @ source.T_rs[:3, :3].T
    bend = _bend(distance, sigma, largest_step)
    best, spread, margin = (np.full(rays.shape[:2], value) for value in (np.inf, np.nan, np.inf))
    for r, c in np.ndindex(height - 1, width - 1):
        corners = [(r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)]
        gaps = [k for k in range(4) if np.isnan(distance[corners[k]])]
        measured = [distance[corner] for corner in corners if not np.isnan(distance[corner])]
        if len(gaps) > 1 or max(measured) - min(measured) > largest_step:
            continue
        for missing in gaps or [1, 2]:
            face = [corner for k, corner in enumerate(corners) if k != missing]
            p = np.array([points[corner] for corner in face])
            normal = np.cross(p[1] - p[0], p[2] - p[0])
            for pixel in np.ndindex(rays.shape[:2]):
                q = rays[pixel]
                far = normal @ (p[0] - origin) / (normal @ q)
                share = np.linalg.solve((p - origin).T, far * q)
                margin[pixel] = min(margin[pixel], np.abs(share).min()) if share.min() > -0.05 else margin[pixel]
                if share.min() >= 0 and 0 < far < best[pixel]:
                    best[pixel] = far
                    gain = [b * (normal @ own_rays[corner]) / (normal @ q) for b, corner in zip(share, face)]
                    noise = sum((g * sigma[corner]) ** 2 for g, corner in zip(gain, face))
                    spread[pixel] = np.sqrt(noise + sum(g * bend[corner] for g, corner in zip(gain, face)) ** 2)
    frayed, undecided = _frayed(source, view, distance, best, largest_step)
    best[frayed], spread[frayed], margin[undecided] = np.nan, np.nan, 0
    return np.where(np.isfinite(best), best, np.nan), spread, margin


def _frayed(
    source: Camera, view: Camera, distance: np.ndarray, best: np.ndarray, largest_step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a view that show something behind a rim within a pixel of the source, and those nearly so far off."""
    frayed, undecided = np.zeros(best.shape, bool), np.zeros(best.shape, bool)
    z = best * view.rays()[..., 2]
    for r, c in np.ndindex(distance.shape[0] - 1, distance.shape[1] - 1):
        for corner in ((r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)):
            if np.nanmax(distance[r : r + 2, c : c + 2], initial=-1) - distance[corner] > largest_step:
                point = source.unproject(distance)[corner]
                here = (view.T_sr @ [*point, 1.0])[2]
                there = distance[corner] * source.rays()[corner][2]
                reach = 0.99 * max(view.fx / source.fx, view.fy / source.fy) * there / here
                columns, rows = np.meshgrid(np.arange(best.shape[1]), np.arange(best.shape[0]))
                off = np.abs(np.stack([columns, rows], axis=-1) - view.project(point)).max(axis=-1)
                frayed |= (off <= reach) & (z > here + largest_step) & np.isfinite(best)
                undecided |= np.abs(off - reach) < 1e-3
    return frayed, undecided


def _bend(distance: np.ndarray, sigma: np.ndarray, largest_step: float) -> np.ndarray:
    """√(Σ max(0, Δ² − 6 σ²) / 120) over rows and columns, Δ the second difference, where it is of one surface."""
    total = np.zeros(distance.shape)
    for axis in range(2):
        d, s = np.moveaxis(distance, axis, 0), np.moveaxis(sigma, axis, 0)
        steps = np.abs(np.diff(d, axis=0))
        one = (steps[:-1] <= largest_step) & (steps[1:] <= largest_step)
        excess = np.where(one, np.maximum(np.diff(d, n=2, axis=0) ** 2 - 6 * s[1:-1] ** 2, 0), 0)
        np.moveaxis(total, axis, 0)[1:-1] += excess
    return np.sqrt(total / 120)
