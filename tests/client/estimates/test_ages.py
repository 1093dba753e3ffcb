"""Ages of estimates whose exposure another host's clock tells."""

import pytest
from abs_client.estimates.ages import PERIOD_NS, Ages
from absmsg.v1.common_pb2 import Header

from tests.client.messages import state


class Far:
    """A host whose clock is an hour behind, and asking it."""

    def __init__(self):
        self.now_ns, self.behind_ns, self.asked = 10_000_000_000_000, 3_600_000_000_000, []
        self.ages = Ages(lambda: self.now_ns, self.asked.append)

    def answer(self, round_trip_ns, clock="far"):
        self.now_ns += round_trip_ns // 2
        then_ns = self.now_ns - self.behind_ns
        self.now_ns += round_trip_ns // 2
        self.ages.add(Header(t_host_ns=then_ns, host_clock=clock))

    def exposed(self, age_ns, **fields):
        return state(1, t_host_ns=self.now_ns - age_ns - self.behind_ns, host_clock="far", **fields)


def test_an_age_is_right_once_the_other_clock_has_answered():
    far = Far()
    estimate = far.exposed(20_000_000, age_ms=15.0)
    assert far.ages.age_s(estimate, far.now_ns - 3_000_000) == pytest.approx(0.018)  # the least that it can be
    assert far.asked == ["far"]
    far.answer(2_000_000)
    assert far.ages.age_s(estimate, far.now_ns) == pytest.approx(0.022, abs=1e-9)


def test_the_answer_with_the_shortest_round_trip_counts():
    far = Far()
    far.ages.age_s(far.exposed(0), far.now_ns)
    far.answer(2_000_000)
    far.now_ns += PERIOD_NS + 1
    far.ages.age_s(far.exposed(0), far.now_ns)
    far.now_ns += 400_000_000  # on the way there only: the reading is wrong by 200 ms
    far.answer(0)
    assert far.ages.age_s(far.exposed(50_000_000), far.now_ns) == pytest.approx(0.05, abs=1e-9)


def test_answers_of_another_clock_do_not_count_and_a_new_clock_is_asked():
    far = Far()
    far.ages.age_s(far.exposed(0), far.now_ns)
    far.answer(2_000_000, clock="other")
    assert far.ages.age_s(far.exposed(0, age_ms=9.0), far.now_ns) == pytest.approx(0.009)
    far.ages.age_s(state(1, host_clock="new"), far.now_ns)
    assert far.asked == ["far", "new"]


def test_without_any_clock_an_age_is_the_time_since_arrival():
    far = Far()
    assert far.ages.age_s(state(1, age_ms=float("nan")), far.now_ns - 30_000_000) == pytest.approx(0.03)
    assert far.asked == []


def test_after_a_pause_of_an_hour_the_new_answer_counts_whatever_its_round_trip():
    far = Far()
    far.ages.age_s(far.exposed(0), far.now_ns)
    far.answer(200_000)
    far.now_ns += 3_600_000_000_000
    far.behind_ns += 300_000_000  # clocks of two hosts drift: 83 ppm
    far.ages.age_s(far.exposed(0), far.now_ns)
    far.answer(4_000_000)
    assert far.ages.age_s(far.exposed(20_000_000), far.now_ns) == pytest.approx(0.02, abs=1e-9)


def test_the_offset_of_a_clock_is_not_used_for_one_that_is_not_told():
    far = Far()
    far.ages.age_s(far.exposed(0), far.now_ns)
    far.answer(2_000_000)
    assert far.ages.age_s(state(1, t_host_ns=5, age_ms=9.0), far.now_ns) == pytest.approx(0.009)
