"""The experiment `rates`: a search's own time, goals, and a short run in a process of its own."""

import math
from dataclasses import replace

import pytest

from evaluation.experiment import Context
from evaluation.method import rates
from evaluation.method.rates.cases import cases
from evaluation.method.rates.measuring import Times, measure


@pytest.mark.slow
def test_a_search_s_own_time_is_a_part_of_its_frame_s():
    found = measure(next(cases(0.01)), 2)
    assert 0 < found.cpu_ms <= found.cpu_p95_ms
    assert 0 < found.search_share < 1


def test_goals_are_about_processor_time_with_one_thread(monkeypatch):
    known = list(cases(1.0))
    monkeypatch.setattr(
        rates, "measured", lambda threads, *_: {one.part: Times(0, 0, k / threads, 0, 0) for k, one in enumerate(known)}
    )
    findings = rates.run(replace(rates.Settings(), threads=(1,)), Context(0))
    assert [goal.value for goal in findings.goals] == [k for k, one in enumerate(known) if not math.isnan(one.goal_ms)]
