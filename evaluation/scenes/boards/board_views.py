"""A board in front of a rig, as OpenCV projects it and as lines meet planes: no code of the solve takes part."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.board.views import CornerView, PlaneView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.pose import Pose

COLUMNS, ROWS, SQUARE = 9, 7, 0.04


def board_points() -> NDArray[np.float64]:
    """Inner corners (63, 3) [m]."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    return np.stack([columns.ravel() * SQUARE, rows.ravel() * SQUARE, np.zeros(rows.size)], axis=1)


@dataclass(frozen=True)
class Head:
    """A simulated sensor.

    Attributes:
        camera: the truth.
        corner_sigma: deviation of corners [px]; 0 if it takes no images.
        depth_sigma: deviation of distances at 1 m, growing with the square of the distance [m]; 0 if it has none.
        depth_offset, depth_scale: systematic error of distances.
    """

    camera: Camera
    corner_sigma: float = 0.0
    depth_sigma: float = 0.0
    depth_offset: float = 0.0
    depth_scale: float = 0.0


def three_heads() -> dict[str, Head]:
    """Time of flight with a coarse amplitude image, structured light with infrared, and colour."""
    tof = Camera(320, 240, 262.0, 261.5, 158.7, 121.2, Lens(np.array([-0.21, 0.06, 0.0004, -0.0003])))
    light = Camera(
        640, 480, 585.0, 586.2, 322.1, 236.4, Lens(np.array([-0.08, 0.11, 0.0002, 0.0005])),
        pose.from_rotation_vector((0.03, -0.12, 0.01), (0.11, 0.004, -0.01)),
    )  # fmt: skip
    color = Camera(
        1280, 720, 921.0, 919.5, 645.3, 352.8, Lens(np.array([0.09, -0.21, 0.0007, -0.0004, 0.08])),
        pose.from_rotation_vector((-0.06, 0.08, -0.02), (-0.06, 0.02, 0.005)),
    )  # fmt: skip
    return {
        "tof": Head(tof, 0.25, 0.004),
        "light": Head(light, 0.12, 0.002),
        "color": Head(color, 0.1),
    }


def random_boards(
    count: int,
    random: np.random.Generator,
    near: float = 0.6,
    far: float = 1.6,
    tilt: tuple[float, float] = (0.15, 0.8),
) -> dict[int, Pose]:
    """Boards by number of the shot, all over the images of `three_heads`, tilted by up to 45 degrees."""
    boards = {}
    for shot in range(count):
        axis = random.uniform(0, 2 * np.pi)
        angle = random.uniform(*tilt)
        spin = pose.from_rotation_vector((0, 0, random.uniform(-0.4, 0.4)), np.zeros(3))
        turn = pose.from_rotation_vector((angle * np.cos(axis), angle * np.sin(axis), 0), np.zeros(3)) @ spin
        z = random.uniform(near, far)
        middle = turn[:3, :3] @ board_points().mean(axis=0)
        turn[:3, 3] = (random.uniform(-0.45, 0.45) * z, random.uniform(-0.32, 0.32) * z, z) - middle
        boards[shot] = turn
    return boards


@dataclass(frozen=True)
class Seen:
    """Views of all heads."""

    corners: list[CornerView] = field(default_factory=list)
    planes: list[PlaneView] = field(default_factory=list)


def look(
    heads: Mapping[str, Head],
    boards: Mapping[int, Pose],
    random: np.random.Generator,
    times: Mapping[int, float] = {},
    points: int = 150,
) -> Seen:
    """Corners and distances of boards `T_rb` in all heads, with noise."""
    seen = Seen()
    for shot, T_rb in boards.items():
        for name, head in heads.items():
            seen.corners.extend(corners(name, head, shot, T_rb, random, times.get(shot, float(shot))))
            seen.planes.extend(distances(name, head, shot, T_rb, random, times.get(shot, float(shot)), points))
    return seen


def corners(name: str, head: Head, shot: int, T_rb: Pose, random: np.random.Generator, time: float) -> list[CornerView]:
    """The corners that a head sees, if it sees a dozen."""
    if head.corner_sigma == 0:
        return []
    pixels = projected(head.camera, T_rb, board_points())
    inside = np.all((pixels > 2) & (pixels < (head.camera.width - 3, head.camera.height - 3)), axis=1)
    if inside.sum() < 12:
        return []
    pixels = pixels[inside] + random.normal(0, head.corner_sigma, (int(inside.sum()), 2))
    return [CornerView(name, shot, time, board_points()[inside], pixels, head.corner_sigma)]


def distances(
    name: str, head: Head, shot: int, T_rb: Pose, random: np.random.Generator, time: float, points: int = 150
) -> list[PlaneView]:
    """Distances along the lines of sight through points of the board, at the pixels where OpenCV shows these."""
    if head.depth_sigma == 0:
        return []
    spread = random.uniform(-0.02, 1.02, (points, 2)) * ((COLUMNS - 1) * SQUARE, (ROWS - 1) * SQUARE)
    points_b = np.concatenate([spread, np.zeros((points, 1))], axis=1)
    pixels = projected(head.camera, T_rb, points_b)
    inside = np.all((pixels > 0) & (pixels < (head.camera.width - 1, head.camera.height - 1)), axis=1)
    if inside.sum() < 20:
        return []
    true = np.linalg.norm(pose.transform(head.camera.T_sr @ T_rb, points_b[inside]), axis=1)
    sigmas = head.depth_sigma * true**2
    measured = (1 + head.depth_scale) * true + head.depth_offset + random.normal(0, sigmas)
    return [PlaneView(name, shot, time, pixels[inside], measured, sigmas)]


def projected(camera: Camera, T_rb: Pose, points_b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (n, 2) by `cv2.projectPoints`."""
    turn, move = pose.to_rotation_vector(camera.T_sr @ T_rb)
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    pixels, _ = cv2.projectPoints(points_b, turn, move, matrix, camera.lens.coefficients)
    return np.asarray(pixels[:, 0], np.float64)
