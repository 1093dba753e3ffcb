"""The loop over frame sets: order, times and deadlines."""

import math
from itertools import count
from typing import Any

import pytest

from abs_service.tracking.tracked_sets import track_sets


class Search:
    """Stands for a session: asks `steps` times whether it is in time, and says how often it was."""

    def __init__(self, steps: int):
        self._steps = steps

    def track(self, frames, in_time):
        return frames, sum(in_time() for _ in range(self._steps))


def results(budget_ns: float, steps: int = 5) -> list[Any]:
    session: Any = Search(steps)
    frame_sets: Any = ["a", "b"]
    return list(track_sets(session, frame_sets, ticking_clock(), budget_ns))


def ticking_clock():
    ticks = count(100, 10)
    return lambda: next(ticks)


def test_every_set_is_tracked_in_order_and_timed():
    (first, second) = results(math.inf)
    assert (first.frames, first.estimate) == ("a", ("a", 5))
    assert (second.frames, second.estimate) == ("b", ("b", 5))
    assert first.took_ns == second.took_ns == 10  # the clock is read before and after, by nothing in between


@pytest.mark.parametrize(("budget_ns", "in_time"), [(31, 3), (11, 1), (0.5, 0)])
def test_a_search_is_in_time_until_its_deadline(budget_ns, in_time):
    assert [estimate for _, estimate, _ in results(budget_ns)] == [("a", in_time), ("b", in_time)]


def test_a_set_is_tracked_when_it_is_asked_for():
    asked: list[str] = []
    session: Any = Search(1)
    tracked = track_sets(session, (asked.append(name) or name for name in "ab"), ticking_clock())  # pyright: ignore
    assert next(tracked).frames == "a"
    assert asked == ["a"]
