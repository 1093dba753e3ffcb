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


def board_pose(rotation: tuple[float, float, float], translation: tuple[float, float, float]) -> Pose:
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
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)
