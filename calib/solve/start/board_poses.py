"""Initial board pose in one camera, with both solutions of a planar target, and an initial focal length."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.lens import LensError
from calib.pose import Pose
from calib.solve.bundle.parameters.lens_parameters import LensKind

#: Candidate focal lengths, relative to the image's width: from a wide fisheye to a telephoto lens.
FOCAL_LENGTHS = np.geomspace(0.25, 4.0, 13)

#: Boards within this angle of each other are held alike [rad].
TILTED = np.deg2rad(10.0)

#: Number of views to try focal lengths on.
TRIED = 6


@dataclass(frozen=True)
class PoseCandidate:
    """Candidate pose of the board in one view.

    Attributes:
        T_sb: pose of the board in the camera's frame.
        rms_px: root mean square reprojection error [px].
    """

    T_sb: Pose
    rms_px: float


def pose_candidates(camera: Camera, view: CornerView) -> list[PoseCandidate]:
    """Candidate poses of the board in a view, best first.

    A small or distant board looks nearly the same under two tilts, so there may be two candidates. Source: T. Collins,
    A. Bartoli, Infinitesimal plane-based pose estimation, IJCV 2014 (OpenCV's IPPE).
    """
    alone = Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, camera.lens)
    try:
        directions = alone.directions(view.pixels)
    except LensError:
        return []
    ideal = directions[:, :2] / directions[:, 2:]
    _, turns, moves, _ = cv2.solvePnPGeneric(
        view.points_b.astype(float), ideal, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE
    )
    poses = [pose.from_rotation_vector(turn[:, 0], move[:, 0]) for turn, move in zip(turns, moves, strict=True)]
    found = [PoseCandidate(T_sb, _rms(alone, view, T_sb)) for T_sb in poses]
    return sorted((each for each in found if np.isfinite(each.rms_px)), key=lambda each: each.rms_px)


def initial_camera(width: int, height: int, kind: LensKind, views: Sequence[CornerView]) -> Camera:
    """Distortion-free camera with the focal length of least reprojection error on some views.

    The accuracy is low but sufficient, since each camera is optimised separately afterwards.
    """
    tried = views[:: max(1, len(views) // TRIED)]
    cameras = [plain_camera(width, height, kind, share * width) for share in FOCAL_LENGTHS]
    return min(cameras, key=lambda camera: _typical_error(camera, tried))


def plain_camera(width: int, height: int, kind: LensKind, focal: float) -> Camera:
    """Distortion-free camera with a focal length [px] and the principal point in the middle of the image."""
    lens = kind.make(np.zeros(len(kind.every)))
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, lens)


def untilted(boards: Collection[Pose]) -> str:
    """End of a sentence on boards that are hardly tilted to each other, so that no focal length follows; or ""."""
    normals = np.stack([T_rb[:3, 2] for T_rb in boards])
    mean = normals.mean(axis=0)
    angle = float(np.arccos(np.clip(normals @ mean / np.linalg.norm(mean), -1, 1)).max())
    return (
        ""
        if angle > TILTED
        else (
            f". Or the board is held alike in all views, to about {np.rad2deg(angle):.0f}°, so that nothing tells a "
            "longer focal length from a larger distance: tilt it by 20° to 40° to all sides"
        )
    )


def _typical_error(camera: Camera, views: Sequence[CornerView]) -> float:
    """Root mean square over the views, without the worst quarter."""
    squares = [found[0].rms_px ** 2 if (found := pose_candidates(camera, view)) else np.inf for view in views]
    kept = np.sort(squares)[: max(1, 3 * len(squares) // 4)]
    return float(np.mean(kept))


def _rms(camera: Camera, view: CornerView, T_sb: Pose) -> float:
    misses: NDArray[np.float64] = camera.project(pose.transform(T_sb, view.points_b)) - view.pixels
    return float(np.sqrt(np.mean(np.sum(misses**2, axis=1))))
