"""The experiment `rates`: a search's own time."""

import pytest

from evaluation.method.rates.cases import cases
from evaluation.method.rates.measuring import measure


@pytest.mark.slow
def test_a_search_s_own_time_is_a_part_of_its_frame_s():
    found = measure(next(cases(0.01)), 2)
    assert 0 < found.cpu_ms <= found.cpu_p95_ms
    assert 0 < found.search_share < 1
