"""E4 and E5 in seconds: what is flat stays flat for the likelihood, and not for the Euclidean fitness."""

import numpy as np
import pytest

from calib import pose
from evaluation.experiment import Context
from evaluation.paper.flat_boards import checkerboard, stripe
from evaluation.paper.flat_boards.comparison import BLACK, WHITE, mean_plane_distance
from evaluation.paper.wall_calibration import calibrated_noise


def test_points_are_as_far_from_their_plane_as_they_were_put():
    places = np.random.default_rng(1).uniform(-1, 1, (500, 2))
    heights = np.where(np.arange(500) % 2, 0.02, -0.02)
    points = pose.transform(pose.from_rotation_vector([0.4, -0.7, 0.2], [1, 2, 3]), np.column_stack([places, heights]))
    assert mean_plane_distance(points) == pytest.approx(0.02, rel=0.01)
    assert mean_plane_distance(points[::2]) == pytest.approx(0, abs=1e-12)


@pytest.mark.slow
def test_static_walls_tell_the_sensor_s_law():
    noise = calibrated_noise("dark=-40", 2, seed=1)
    assert noise.mu_amplitude == pytest.approx(-40, rel=0.01)
    assert noise.sigma_amplitude == pytest.approx(9, rel=0.03)


def test_both_boards_are_half_black_or_less_and_as_dark_as_they_say():
    for board, share in ((checkerboard.BOARD, 1 / 2), (stripe.BOARD, 1 / 3)):
        reflectivity = board.texture.texels[..., 3]
        assert np.mean(reflectivity < (BLACK + WHITE) / 2) == pytest.approx(share, abs=0.01)
        assert np.quantile(reflectivity, [0.1, 0.9]) == pytest.approx([BLACK, WHITE], abs=0.01)


@pytest.mark.slow
def test_the_likelihood_keeps_a_flat_board_flat():
    findings = stripe.run(stripe.QUICK, Context(0))
    for goal in findings.goals:
        assert goal.met, goal
    bend = findings.values["FlexPad, hybrid, 20 frames"]["likelihood"]["mean"]
    assert bend < 0.15
    unevenness_mm = findings.values["NURBS, hybrid, 20 frames"]["likelihood"]["mean"]
    assert unevenness_mm < 5
    assert [section.title for section in findings.sections] == ["The scene", "Errors"]
