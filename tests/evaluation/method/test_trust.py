"""The statistics of the experiment on trust."""

import numpy as np

from evaluation.method.trust import SLIDE_FRAME, Followed, Slide, creep
from evaluation.scenes.bent_sheet import INTERVAL_S, swing


def test_a_frame_is_wrong_if_it_claims_tracking_beyond_three_deviations_and_five_millimetres():
    error = np.array([4e-3, 6e-3, 6e-3, 6e-3, 20e-3, 20e-3, 4e-3])
    sigma = np.array([1e-4, 1e-3, 3e-3, 1e-3, 1e-3, 1e-3, 1e-3])
    tracking = np.array([True, True, True, True, True, False, True])
    found = Followed(error, sigma, tracking)
    np.testing.assert_array_equal(found.wrong, [False, True, False, True, True, False, False])
    assert found.longest_wrong == 2


def test_a_slide_moves_the_sheet_along_itself_from_its_frame_on():
    before, after = (SLIDE_FRAME - 1) * INTERVAL_S, SLIDE_FRAME * INTERVAL_S
    slide = Slide(0.04)
    assert slide(before) == swing(before)
    moved = np.subtract(slide(after).center, swing(after).center)
    np.testing.assert_allclose(np.linalg.norm(moved), 0.04, rtol=1e-9)
    np.testing.assert_allclose(np.subtract(creep(INTERVAL_S).center, creep(0).center), [2e-3, 0, 0], atol=1e-12)
