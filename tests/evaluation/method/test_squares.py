"""Paired differences."""

import numpy as np
import pytest

from evaluation.statistics import upper_end


def test_the_upper_end_is_above_the_mean_by_the_half_width_of_student():
    first, second = [1.0, 2.0, 3.0, 4.0, 5.0], [0.0] * 5
    assert upper_end(first, second) == pytest.approx(3 + 2.776 * np.sqrt(2.5 / 5), abs=1e-3)
    assert upper_end(second, first) == pytest.approx(-3 + 2.776 * np.sqrt(2.5 / 5), abs=1e-3)


def test_one_sequence_says_nothing():
    assert np.isnan(upper_end([1.0], [0.0]))
