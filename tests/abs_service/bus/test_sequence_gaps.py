"""Messages that never came are counted, and nothing else."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.bus.sequence_gaps import SequenceGaps


def lost(*numbers, gaps=None, boot_id="a"):
    gaps = gaps or SequenceGaps()
    for number in numbers:
        gaps.add("image", boot_id, number)
    return gaps.lost.get("image", 0)


@given(st.lists(st.booleans(), min_size=2, max_size=50))
def test_all_between_the_first_and_the_last_that_came_are_counted(came):
    numbers = [number for number, arrived in enumerate(came) if arrived]
    assert lost(*numbers) == (numbers[-1] - numbers[0] + 1 - len(numbers) if numbers else 0)


def test_a_restarted_publisher_counts_anew():
    gaps = SequenceGaps()
    assert lost(7, 9, gaps=gaps) == 1
    assert lost(100, 102, gaps=gaps, boot_id="b") == 2


def test_two_publishers_of_a_topic_are_told_apart():
    gaps = SequenceGaps()
    found = [
        gaps.add("health/capture", *one) for one in (("a", 7), ("b", 70), ("a", 8), ("b", 72), ("a", 9), ("b", 73))
    ]
    assert found == [0, 0, 0, 1, 0, 0]


def test_a_flood_of_publishers_does_not_fill_the_memory():
    gaps = SequenceGaps()
    for number in range(1000):
        gaps.add("image", str(number), number)
    assert [gaps.add("image", publisher, 1002) for publisher in ("0", "999")] == [0, 2]


@pytest.mark.parametrize("numbers", [(5, 5, 5), (0, 2**64 - 1) * 10, (9, 3)])
def test_numbers_that_are_none_are_no_loss(numbers):
    assert lost(*numbers) == 0
