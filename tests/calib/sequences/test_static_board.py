"""Boards in front of a depth sensor: is the reported deviation of their distances that of the errors?"""

import numpy as np
import pytest

from calib import pose
from calib.board.target import Chessboard
from calib.board.views import CornerView
from calib.camera import Camera
from calib.noise.base import NoiseError
from calib.sequences.static_board import locate

TOF = Camera(176, 144, 200.0, 200.0, 87.5, 71.5)
COLOR = Camera(640, 480, 600.0, 600.0, 320.0, 240.0, T_rs=pose.from_rotation_vector((0, 0, 0), (0.06, 0, 0)))
POINTS = Chessboard(8, 5, 0.04).points()
T_RB = pose.from_rotation_vector((0.2, -0.35, 0.1), (-0.13, -0.07, 0.8))


def seen(camera: Camera, noise_px: float, seed: int) -> CornerView:
    noise = noise_px * np.random.default_rng(seed).standard_normal((len(POINTS), 2))
    return CornerView("x", 0, 0.0, POINTS, camera.project(pose.transform(T_RB, POINTS)) + noise)


def along_rays(inside: np.ndarray) -> np.ndarray:
    """Real distances of some pixels of `TOF`, where their rays pierce the board's plane."""
    rays = TOF.rays()[inside]
    return (T_RB[:3, 2] @ T_RB[:3, 3]) / (rays @ T_RB[:3, 2])


@pytest.mark.parametrize("camera", [TOF, COLOR], ids=["its own image", "another sensor's"])
def test_distances_err_by_as_much_as_is_said(camera: Camera) -> None:
    errors, said = [], []
    for seed in range(30):
        found = locate(seen(camera, 0.1, seed), camera, TOF)
        distance = 1 / (TOF.rays()[found.inside] @ found.plane)
        errors.append(np.mean((distance - along_rays(found.inside)) ** 2))
        said.append(found.uncertainty**2)
    assert np.sqrt(np.mean(said) / np.mean(errors)) == pytest.approx(1, abs=0.25)
    assert np.sqrt(np.mean(errors)) < 1.5e-3


def test_only_pixels_well_inside_the_points_count() -> None:
    found = locate(seen(COLOR, 0.0, 0), COLOR, TOF)
    hull = TOF.project(pose.transform(T_RB, POINTS))
    rows, columns = np.nonzero(found.inside)
    assert found.inside.sum() > 1000
    assert columns.min() >= hull[:, 0].min() + 1
    assert columns.max() <= hull[:, 0].max() - 1
    assert rows.min() >= hull[:, 1].min() + 1
    assert rows.max() <= hull[:, 1].max() - 1


def test_a_board_that_the_depth_sensor_cannot_see_is_refused() -> None:
    away = Camera(176, 144, 200.0, 200.0, 87.5, 71.5, T_rs=pose.from_rotation_vector((0, np.pi, 0), (0, 0, 0)))
    with pytest.raises(NoiseError, match="does not see the board"):
        locate(seen(COLOR, 0.0, 0), COLOR, away)
