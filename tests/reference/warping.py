"""Depth images as the camera of another image sees them."""

import numpy as np

from calib.camera import Camera


def warped(
    source: Camera, view: Camera, distance: np.ndarray, sigma: np.ndarray, maximum_step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """View of the faces between neighbouring pixels, each a plane that the view's rays meet.

    Returns:
        Radial distances, their deviations, and by which share of a face's corners a pixel is near to any face's edge.
    """
    height, width = distance.shape
    points, origin = source.unproject(distance), view.center
    rays, own_rays = view.rays() @ view.T_rs[:3, :3].T, source.rays() @ source.T_rs[:3, :3].T
    bend = _bend(distance, sigma, maximum_step)
    best, spread, margin = (np.full(rays.shape[:2], value) for value in (np.inf, np.nan, np.inf))
    for r, c in np.ndindex(height - 1, width - 1):
        corners = [(r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)]
        gaps = [k for k in range(4) if np.isnan(distance[corners[k]])]
        measured = [distance[corner] for corner in corners if not np.isnan(distance[corner])]
        if len(gaps) > 1 or max(measured) - min(measured) > maximum_step:
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
    frayed, undecided = _frayed(source, view, distance, best, maximum_step)
    best[frayed], spread[frayed], margin[undecided] = np.nan, np.nan, 0
    return np.where(np.isfinite(best), best, np.nan), spread, margin


def _frayed(
    source: Camera, view: Camera, distance: np.ndarray, best: np.ndarray, maximum_step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a view that show something behind a rim within a pixel of the source, and those nearly so far off."""
    frayed, undecided = np.zeros(best.shape, bool), np.zeros(best.shape, bool)
    z = best * view.rays()[..., 2]
    for r, c in np.ndindex(distance.shape[0] - 1, distance.shape[1] - 1):
        for corner in ((r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)):
            if np.nanmax(distance[r : r + 2, c : c + 2], initial=-1) - distance[corner] > maximum_step:
                point = source.unproject(distance)[corner]
                here = (view.T_sr @ [*point, 1.0])[2]
                there = distance[corner] * source.rays()[corner][2]
                reach = 0.99 * max(view.fx / source.fx, view.fy / source.fy) * there / here
                columns, rows = np.meshgrid(np.arange(best.shape[1]), np.arange(best.shape[0]))
                off = np.abs(np.stack([columns, rows], axis=-1) - view.project(point)).max(axis=-1)
                frayed |= (off <= reach) & (z > here + maximum_step) & np.isfinite(best)
                undecided |= np.abs(off - reach) < 1e-3
    return frayed, undecided


def _bend(distance: np.ndarray, sigma: np.ndarray, maximum_step: float) -> np.ndarray:
    """√(Σ max(0, Δ² − 6 σ²) / 120) over rows and columns, Δ the second difference, where it is of one surface."""
    total = np.zeros(distance.shape)
    for axis in range(2):
        d, s = np.moveaxis(distance, axis, 0), np.moveaxis(sigma, axis, 0)
        steps = np.abs(np.diff(d, axis=0))
        one = (steps[:-1] <= maximum_step) & (steps[1:] <= maximum_step)
        excess = np.where(one, np.maximum(np.diff(d, n=2, axis=0) ** 2 - 6 * s[1:-1] ** 2, 0), 0)
        np.moveaxis(total, axis, 0)[1:-1] += excess
    return np.sqrt(total / 120)
