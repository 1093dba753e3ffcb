"""The experiment `page_cost`: what the page's process uses is held against the bound of its part."""

import os
import time

import pytest

from evaluation.service import page_cost
from evaluation.service.page_cost import Part


@pytest.mark.parametrize(("cores", "missed"), [((0.01, 0.19, 0.01), 0), ((0.03, 0.19, 0.01), 1), ((0.03, 0.3, 0.1), 3)])
def test_a_browser_may_cost_more_than_none(cores, missed):
    found = page_cost.findings({name: Part(one, 30.0) for name, one in zip(page_cost.PARTS, cores)})
    assert sum(not goal.met for goal in found.goals) == missed
    assert [one[0] for one in found.values.values()] == list(cores)


def test_processor_time_is_that_of_the_process(monkeypatch):
    monkeypatch.setattr(page_cost, "SETTLED_S", 0.0)
    idle = page_cost.measured(os.getpid(), (), 0.2)
    sleep = time.sleep
    monkeypatch.setattr(time, "sleep", lambda s: (_compute(s), sleep(0)))
    assert page_cost.measured(os.getpid(), (), 0.2).cores > idle.cores


def _compute(seconds):
    end_s = time.thread_time() + seconds
    while time.thread_time() < end_s:
        pass
