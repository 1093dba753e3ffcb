"""The experiment `growth`: laws, walls and extrapolations."""

import math
import os

import numpy as np
import pytest

from evaluation.service import growth
from evaluation.service.frame_budget.live import Observed
from evaluation.service.growth import hosts, services
from evaluation.service.growth.frames import axes
from evaluation.service.growth.hosts import Costs
from evaluation.service.growth.laws import Law, fit
from evaluation.service.growth.services import Services

NUMBERS = (10.0, 20.0, 40.0, 80.0)


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_a_law_is_found_that_is_true(power: float) -> None:
    law = fit(NUMBERS, [3 + 0.25 * one**power for one in NUMBERS], power)
    assert (law.start, law.each, law.determination) == pytest.approx((3, 0.25, 1))
    assert law.time(law.wall(33.0)) == pytest.approx(33)


def test_a_law_of_the_wrong_form_explains_less() -> None:
    assert fit(NUMBERS, [one**3 for one in NUMBERS], 1.0).determination < growth.DETERMINATION


def test_there_is_no_wall_where_nothing_grows() -> None:
    assert Law(1.0, 3.0, 0.0, 1.0).wall(33.0) == math.inf
    assert Law(1.0, 40.0, 1.0, 1.0).wall(33.0) == 0


def test_what_could_not_be_measured_has_no_law() -> None:
    law = fit(NUMBERS, [1.0, 2.0, math.nan, 4.0])
    assert math.isnan(law.determination)
    assert any(math.isnan(float(row[1] or 0)) for row in hosts.table(Costs(5.0, 1.0, 4.0, law)).rows)


def test_larger_hosts_carry_what_the_costs_say() -> None:
    costs = Costs(5.0, 1.0, 4.0, Law(1.0, 0.0, 10.0, 1.0))
    assert costs.cores(1) == pytest.approx(0.6)
    assert costs.cores(2) == pytest.approx(0.9)
    assert costs.most_trackers(0.91) == 2
    numbers = {str(row[0]): row[1] for row in hosts.table(costs).rows}
    assert numbers["rigs with one tracker on 64 cores, 70% of them used"] == 74


def test_every_axis_has_numbers_enough_for_its_law() -> None:
    assert all(len(axis.setups) >= 4 for axis in axes())
    assert {axis.power for axis in axes()} == {1, 2}


def observed(skipped: int, cores: float) -> Observed:
    return Observed(
        np.full(99, 15.0), 30.0, skipped, skipped, skipped, 1.0, {"track": 0.6 * cores, "run": 0.4 * cores}, {}
    )


def test_rigs_side_by_side_are_held_against_the_laws() -> None:
    costs = Costs(5.0, 1.0, 4.0, Law(1.0, 0.0, 10.0, 1.0))
    kept = Services({}, costs, [observed(0, 0.6), observed(1, 0.7)])
    assert [goal.met for goal in services.goals(kept)] == [True, True, True]
    missed = Services({}, costs, [observed(1, 0.8), observed(2, 0.9)])
    assert [goal.met for goal in services.goals(missed)] == [False, True, False]
    assert services.values(missed)["side_by_side"][1]["cores"] == pytest.approx(0.9)


@pytest.mark.parametrize(("capture_ms", "rigs"), [(5.0, 18), (1000.0, 1), (math.nan, 1)])
def test_as_many_rigs_run_as_the_cores_of_this_host_carry(
    capture_ms: float, rigs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs = Costs(capture_ms, 1.0, 4.0, Law(1.0, 0.0, 10.0, 1.0))
    monkeypatch.setattr(os, "cpu_count", lambda: 16)
    monkeypatch.setattr(services, "write_take", lambda *_: None)
    monkeypatch.setattr(services, "costs_of", lambda _: costs)
    monkeypatch.setattr(services.live, "observe", lambda *_, progress: observed(0, 0.6))
    assert len(services.measure((), 1.0, 1, lambda _: None).beside) == rigs
