"""Size of a board that is far from its description, from the stored distances between sensors and measured ones."""

from itertools import combinations

import numpy as np

from calib.board.views import CornerView, PlaneView
from calib.calibration_check.stored_calibration import Stored, Views
from calib.pose import Pose
from calib.solve.start.board_poses import pose_candidates

#: Factors further from 1 are gross: too large for `hypotheses`, in which changes are linear.
GROSS = 1.2

#: Least number of estimates. Most of them have to agree with their median up to a share of it.
MIN_KNOWN, AGREEING, TOLERANCE = 3, 0.7, 0.05

#: Pairs of sensors that stand nearer to each other than this share of the board's distance say nothing.
MIN_BASELINE = 0.02


def gross_size(stored: Stored, views: Views) -> float:
    """Factor by which a board is larger than described, if that is gross and beyond doubt, otherwise 1."""
    boards: dict[int, list[tuple[CornerView, Pose]]] = {}
    for view in views.corners:
        if found := pose_candidates(stored.sensors[view.sensor].camera, view):
            boards.setdefault(view.shot, []).append((view, found[0].T_sb))
    estimates = [_by_pair(stored, *pair) for seen in boards.values() for pair in combinations(seen, 2)]
    estimates += [_by_plane(stored, seen, view) for view in views.planes for seen in boards.get(view.shot, [])[:1]]
    known = np.array([each for each in estimates if np.isfinite(each)])
    size = float(np.median(known)) if len(known) >= MIN_KNOWN else 1.0
    is_gross = size > 0 and abs(np.log(size)) > np.log(GROSS)
    return size if is_gross and np.mean(np.abs(known / size - 1) < TOLERANCE) > AGREEING else 1.0


def _by_pair(stored: Stored, one: tuple[CornerView, Pose], other: tuple[CornerView, Pose]) -> float:
    """Factor from the distance between two sensors; NaN if they are too near to each other."""
    cameras = [stored.sensors[view.sensor].camera for view, _ in (one, other)]
    moves = [camera.T_rs[:3, :3] @ T_sb[:3, 3] for camera, (_, T_sb) in zip(cameras, (one, other), strict=True)]
    between, said = cameras[1].center - cameras[0].center, moves[0] - moves[1]
    size = float(between @ said / max(said @ said, 1e-12))
    is_short = np.linalg.norm(between) < MIN_BASELINE * abs(size) * np.linalg.norm(moves[0])
    return float("nan") if is_short else size


def _by_plane(stored: Stored, seen: tuple[CornerView, Pose], view: PlaneView) -> float:
    """Factor from the distances that a sensor measured."""
    state, camera, T_sb = stored.sensors[view.sensor], stored.sensors[seen[0].sensor].camera, seen[1]
    normal, move = camera.T_rs[:3, :3] @ T_sb[:3, 2], camera.T_rs[:3, :3] @ T_sb[:3, 3]
    rays = state.camera.directions(view.pixels) @ state.camera.T_rs[:3, :3].T
    true = (view.distances - state.depth_offset) / (1 + state.depth_scale)
    between = normal @ (camera.center - state.camera.center)
    return float(np.median((true * (rays @ normal) - between) / (normal @ move)))
