"""Centres of discs through a lens that bends them, and with noise on their black."""

import numpy as np
import pytest

from calib.board.corners.detection import detect
from calib.board.target import AsymmetricCircles, Circles
from calib.pose import transform
from evaluation.scenes.boards.board_images import VGA, as_bytes, centered, photograph, photograph_by_fisheye


@pytest.mark.parametrize("target", [Circles(9, 7, 0.03, 0.018), AsymmetricCircles(4, 11, 0.02, 0.016)], ids=repr)
@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.3, -0.3, 0.1)])
def test_centres_of_discs_are_right_through_a_fisheye(target: Circles | AsymmetricCircles, rotation) -> None:
    """A lens moves the centre of a disc's image, too: with perspective alone they were up to 0.6 px beside."""
    image, places = photograph_by_fisheye(target, centered(target, rotation, 0.15))
    found = detect(target, as_bytes(image))
    error = min(np.abs(found.pixels - order[found.ids]).max() for order in (places, places[::-1]))
    assert error < 0.25


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("target", [Circles(9, 7, 0.03, 0.018), AsymmetricCircles(4, 11, 0.02, 0.016)], ids=repr)
def test_noise_on_black_moves_no_centre(target: Circles | AsymmetricCircles, seed: int) -> None:
    """Thresholds within the noise tore discs apart: with the usual γ, single centres were up to 0.5 px beside."""
    T_sb = centered(target, (0.3, -0.2, 0.1), 0.33)
    random = np.random.default_rng(seed)
    light = photograph(target, VGA, T_sb, black=0.08, white=0.8, noise=0.0, seed=seed)
    electrons = random.poisson(2500 * light) + random.normal(0, 5, light.shape)
    found = detect(target, as_bytes((255 * np.clip(electrons / 2500, 0, 1) ** 0.45).astype(np.float32)))
    points = transform(T_sb, target.points())
    places = points[:, :2] / points[:, 2:] * (VGA.fx, VGA.fy) + (VGA.cx, VGA.cy)
    errors = [np.linalg.norm(found.pixels - order[found.ids], axis=1).max() for order in (places, places[::-1])]
    assert min(errors) < 0.1
