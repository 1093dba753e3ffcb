"""Messages that never came are counted, and nothing else."""

import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.health_pb2 import Health
from hypothesis import given
from hypothesis import strategies as st

from abs_service.bus.contract import Sample
from abs_service.bus.sequence_gaps import LATE_NS, SequenceGaps


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


def health(counters: dict[str, int], component: str = "capture", boot_id: str = "a") -> Sample:
    message = Health(header=Header(boot_id=boot_id), component=component, counters=counters)
    return Sample(f"health/{component}", Health.DESCRIPTOR.full_name, message.SerializeToString())


class Tail:
    """Messages 0 and 1 came, and a health says that there were six; `now_ns` is the time since it."""

    def __init__(self, said: Sample = health({"published.image": 6})) -> None:  # noqa: B008 - a constant
        self.now_ns = 0
        self.gaps = SequenceGaps(lambda: self.now_ns)
        lost(0, 1, gaps=self.gaps)
        self.gaps.add_health(said)

    def after(self, t_ns):
        self.now_ns = t_ns
        return self.gaps.lost.get("image", 0)


def test_what_follows_the_last_that_came_is_lost_a_second_after_its_publisher_has_said_how_many_there_were():
    tail = Tail()
    assert [tail.after(t_ns) for t_ns in (0, LATE_NS - 1, LATE_NS, 2 * LATE_NS)] == [0, 0, 4, 4]
    assert tail.gaps.add("image", "a", 5) == 0, "it came later still"
    assert [tail.gaps.add("image", "a", seq) for seq in (6, 8)] == [0, 1]
    assert tail.after(3 * LATE_NS) == 5


@given(st.lists(st.booleans(), max_size=20))
def test_each_message_that_health_has_said_is_lost_or_came(came):
    tail = Tail()
    for number, arrived in enumerate(came, 2):
        if arrived:
            tail.gaps.add("image", "a", number)
    tail.gaps.add_health(health({"published.image": 2 + len(came)}))
    assert tail.after(LATE_NS) == max(4, len(came)) - sum(came)


def test_at_the_end_it_is_counted_at_once():
    tail = Tail()
    tail.gaps.settle()
    assert tail.after(0) == 4


@pytest.mark.parametrize(
    "said", [health({"published.image": 6}, boot_id="b"), *(health({"published.image": n}) for n in (2**64 - 1, 0))]
)
def test_what_another_process_or_none_of_ours_says_is_no_loss(said):
    assert Tail(said).after(LATE_NS) == 0


def test_estimates_are_counted_by_the_health_of_their_tracker():
    tail = Tail()
    tail.gaps.add("sheet/state", "a", 0)
    tail.gaps.add_health(health({"estimates": 3}, "track/sheet"))
    tail.after(LATE_NS)
    assert tail.gaps.lost["sheet/state"] == 2
