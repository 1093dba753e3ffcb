"""Centres of discs through a lens that bends them."""

import numpy as np
import pytest

from calib.board.corners.detection import detect
from calib.board.target import AsymmetricCircles, Circles
from evaluation.scenes.boards.board_images import as_bytes, centered, photograph_by_fisheye


@pytest.mark.parametrize("target", [Circles(9, 7, 0.03, 0.018), AsymmetricCircles(4, 11, 0.02, 0.016)], ids=repr)
@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.3, -0.3, 0.1)])
def test_centres_of_discs_are_right_through_a_fisheye(target: Circles | AsymmetricCircles, rotation) -> None:
    """A lens moves the centre of a disc's image, too: with perspective alone they were up to 0.6 px beside."""
    image, places = photograph_by_fisheye(target, centered(target, rotation, 0.15))
    found = detect(target, as_bytes(image))
    error = min(np.abs(found.pixels - order[found.ids]).max() for order in (places, places[::-1]))
    assert error < 0.25
