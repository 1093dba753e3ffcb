"""Messages that never came are counted, and nothing else."""

import pytest
from absmsg.v1.common_pb2 import Header
from hypothesis import given
from hypothesis import strategies as st

from abs_service.bus.sequence_gaps import SequenceGaps


def lost(*numbers, gaps=None, boot_id="a"):
    gaps = gaps or SequenceGaps()
    for number in numbers:
        gaps.add("image", Header(seq=number, boot_id=boot_id))
    return gaps.lost.get("image", 0)


@given(st.lists(st.booleans(), min_size=2, max_size=50))
def test_all_between_the_first_and_the_last_that_came_are_counted(came):
    numbers = [number for number, arrived in enumerate(came) if arrived]
    assert lost(*numbers) == (numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 0)


def test_a_restarted_publisher_counts_anew():
    gaps = SequenceGaps()
    assert lost(7, 9, gaps=gaps) == 1
    assert lost(100, 102, gaps=gaps, boot_id="b") == 2


@pytest.mark.parametrize("numbers", [(5, 5, 5), (0, 2**64 - 1) * 10, (9, 3)])
def test_numbers_that_are_none_are_no_loss(numbers):
    assert lost(*numbers) == 0
