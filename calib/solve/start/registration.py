"""Initial pose of a depth sensor that measured only the board's plane."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calib.board.views import PlaneView
from calib.camera import Camera
from calib.pose import Pose, nearest_rotation
from calib.solve.start.extrinsics_graph import NotConnectedError

#: Normals span the space if their smallest singular value, relative to the largest, is above this.
SPANNING = 0.03

#: Units differ by a larger factor; it has to leave less than this share of the misfit, of this many planes.
OTHER_UNIT, CLEARLY, MIN_FOR_UNIT = 2.0, 0.1, 6


def fit_plane(camera: Camera, view: PlaneView) -> tuple[NDArray[np.float64], float]:
    """Normal n (3,), away from the sensor, and distance h [m] of the plane n · p = h, in the sensor's frame."""
    points = camera.directions(view.pixels) * view.distances[:, None]
    normal = center = np.median(points, axis=0)
    # Flying pixels would turn the first plane to themselves; on a tilted board distances are 2 medians off at most.
    away = np.abs(view.distances - np.median(view.distances))
    kept = away <= 3 * np.median(away) + 1e-9
    for _ in range(3):  # refitted without outliers
        _, _, axes = np.linalg.svd(points[kept] - points[kept].mean(axis=0), full_matrices=False)
        normal, center = axes[2], points[kept].mean(axis=0)
        away = np.abs((points - center) @ normal)
        kept = away <= 3 * np.median(away) + 1e-9
    normal = normal * np.sign(normal @ center)
    return normal, float(normal @ center)


def register(name: str, camera: Camera, views: Sequence[PlaneView], boards: Mapping[int, Pose]) -> Pose:
    """Pose `T_rs` that aligns a sensor's planes with boards at known poses: rotation from normals, then translation.

    Raises:
        NotConnectedError: fewer than three planes, or their normals do not span the space.
    """
    shared = [view for view in views if view.shot in boards]
    if len(shared) < 3:
        raise NotConnectedError(
            f"{name}: sees no corners, and the board's plane in {len(shared)} shots; at least 3 needed"
        )
    found = [fit_plane(camera, view) for view in shared]
    normals_s = np.stack([normal for normal, _ in found])
    normals_r = np.stack([boards[view.shot][:3, 2] for view in shared])
    strengths = np.linalg.svd(normals_r.T @ normals_s, compute_uv=False)
    if strengths[2] < SPANNING**2 * strengths[0]:
        raise NotConnectedError(
            f"{name}: sees no corners, and the board was tilted too little for its plane alone to say where {name} is; "
            "tilt it up, down, left and right by 30 degrees"
        )
    T_rs = np.eye(4)
    T_rs[:3, :3] = nearest_rotation(normals_r.T @ normals_s)
    heights_r = np.array([boards[view.shot][:3, 2] @ boards[view.shot][:3, 3] for view in shared])
    heights_s = np.array([height for _, height in found])
    T_rs[:3, 3] = np.linalg.lstsq(normals_r, heights_r - heights_s, rcond=None)[0]
    off = heights_r - heights_s - normals_r @ T_rs[:3, 3]
    _check_unit(name, normals_r, heights_r, heights_s, float(np.std(off)))
    return T_rs


def _check_unit(
    name: str,
    normals_r: NDArray[np.float64],
    heights_r: NDArray[np.float64],
    heights_s: NDArray[np.float64],
    off_m: float,
) -> None:
    """Refuses distances that fit the boards only if all are multiplied by a factor that no sensor errs by.

    `off_m` is the deviation by which they miss the boards as they are.
    """
    columns = np.column_stack([normals_r, heights_s])
    fitted = np.linalg.lstsq(columns, heights_r, rcond=None)[0]
    left_m = np.std(heights_r - columns @ fitted)
    if len(heights_s) >= MIN_FOR_UNIT and left_m < CLEARLY * off_m and not 1 / OTHER_UNIT < fitted[3] < OTHER_UNIT:
        raise NotConnectedError(
            f"{name}: its distances are {1 / fitted[3]:.3g} times as long as those of the boards: correct their unit, "
            "or the size in the description of the board"
        )
