"""Images of boards from an independent renderer: a pinhole looks at the print through a homography, area by area."""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.artwork import rasterize
from calib.board.target import Target
from calib.camera import Camera
from calib.pose import Pose

VGA = Camera(640, 480, 550, 550, 319.5, 239.5)
TOF = Camera(176, 144, 220, 220, 87.5, 71.5)
_WIDE = Camera(2000, 1600, 400, 400, 999.5, 799.5)
_FISHEYE_PX, _FISHEYE_CENTER = 220.0, (319.5, 239.5)


def board_pose(rotation: tuple[float, float, float], translation: tuple[float, float, float]) -> Pose:
    """Pose `T_sb` from a rotation vector [rad] and a translation [m]."""
    return pose.from_rotation_vector(rotation, translation)


def centered(target: Target, rotation: tuple[float, float, float], distance: float) -> Pose:
    """The board's middle on the optical axis, turned about itself."""
    T_sb = pose.from_rotation_vector(rotation, (0, 0, distance))
    T_sb[:3, 3] -= T_sb[:3, :3] @ target.points().mean(axis=0)
    return T_sb


def photograph(
    target: Target,
    camera: Camera,
    T_sb: Pose,
    black: float = 30.0,
    white: float = 200.0,
    noise: float = 2.0,
    blur: tuple[float, float] = (0.5, 0.5),
    samples: int = 4,
    seed: int = 1,
) -> NDArray[np.float32]:
    """Brightness (height, width) of a board before a grey wall.

    The print is a fine raster, warped `samples` times finer than the image and averaged, so that a pixel is the mean
    over its area. A pinhole's map from a plane is a homography.
    """
    density = 3 * samples * camera.fx / T_sb[2, 3] / 4
    print_, (x0, y0) = rasterize(target, density)
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    plane_to_pixel = K @ np.column_stack([T_sb[:3, 0], T_sb[:3, 1], T_sb[:3, 3]])
    texel_to_plane = np.array([[1 / density, 0, x0], [0, 1 / density, y0], [0, 0, 1]])
    finer = np.array([[samples, 0, (samples - 1) / 2], [0, samples, (samples - 1) / 2], [0, 0, 1]])
    H = finer @ plane_to_pixel @ texel_to_plane
    size = (samples * camera.width, samples * camera.height)
    wall = 0.5 * (black + white)
    levels = black + (white - black) * print_
    image = cv2.warpPerspective(
        levels, H, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=wall
    )
    image = cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), sigmaX=max(blur[0], 1e-3), sigmaY=max(blur[1], 1e-3))
    generator = np.random.default_rng(seed)
    return (image + noise * generator.standard_normal(image.shape)).astype(np.float32)


def as_bytes(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Levels rounded to 8 bits."""
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def photograph_by_fisheye(
    target: Target, T_sb: Pose, noise: float = 2.0, blur: float = 0.5
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Brightness (480, 640) of a board through an equidistant fisheye, and where its points are (n, 2) [px].

    A wide pinhole's image, finer than the fisheye's, is mapped to it, which has `_FISHEYE_PX` pixels per radian.
    """
    flat = photograph(target, _WIDE, T_sb, noise=0.0, samples=1)
    v, u = np.mgrid[:480, :640].astype(np.float32)
    du, dv = u - _FISHEYE_CENTER[0], v - _FISHEYE_CENTER[1]
    radius = np.maximum(np.hypot(du, dv), 1e-6)
    reach = _WIDE.fx * np.tan(np.minimum(radius / _FISHEYE_PX, 1.5)) / radius
    at = np.stack([_WIDE.cx + reach * du, _WIDE.cy + reach * dv]).astype(np.float32)
    image = cv2.remap(flat, at[0], at[1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=115.0)
    image = cv2.GaussianBlur(image, (0, 0), blur)
    points = pose.transform(T_sb, target.points())
    beside = np.linalg.norm(points[:, :2], axis=1)
    angle = np.arctan2(beside, points[:, 2])
    pixels = np.array(_FISHEYE_CENTER) + _FISHEYE_PX * (angle / np.maximum(beside, 1e-12))[:, None] * points[:, :2]
    generator = np.random.default_rng(1)
    return (image + noise * generator.standard_normal(image.shape)).astype(np.float32), pixels
