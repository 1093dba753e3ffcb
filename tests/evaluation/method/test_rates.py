"""The experiment `rates`: a search's own time, goals, and a short run in a process of its own."""

import math

import pytest

from evaluation.experiment import Context
from evaluation.method import rates
from evaluation.method.rates.cases import cases
from evaluation.method.rates.measuring import measure


@pytest.mark.slow
def test_a_search_s_own_time_is_a_part_of_its_frame_s():
    found = measure(next(cases(0.01)), 2)
    assert 0 < found.cpu_ms <= found.cpu_p95_ms
    assert 0 < found.search_share < 1


@pytest.mark.slow
def test_every_goal_has_its_time_in_a_short_run():
    findings = rates.run(rates.QUICK, Context(0))
    parts = [one.part for one in cases(rates.QUICK.scale)]
    assert list(findings.values["1"]) == parts
    with_goals = [one for one in cases(rates.QUICK.scale) if not math.isnan(one.goal_ms)]
    assert [goal.value for goal in findings.goals] == [findings.values["1"][one.part]["cpu_ms"] for one in with_goals]
