"""The experiment `clients`: ages are read from what programs print, and every program prints some."""

import sys
from pathlib import Path

import numpy as np
import pytest

from abs_service.report.content import Table
from evaluation.experiment import Context
from evaluation.service import clients
from evaluation.service.clients.programs import Program, ages_ms

PRINTING = """
import itertools, time
for number in itertools.count():
    print("no age" if number % 2 else f"published 9.0 ms, here {number}.5 ms", flush=True)
    time.sleep(0.05)
"""


def test_ages_are_those_after_the_warm_up():
    ages = ages_ms(Program("counting", Path(__file__), (sys.executable, "-c", PRINTING)), 0.5)
    assert 2 < len(ages) <= 10
    assert ages[0] > 5
    np.testing.assert_allclose(np.diff(ages), 2)


def test_a_program_that_prints_none_has_no_age():
    assert np.isnan(ages_ms(Program("silent", Path(__file__), (sys.executable, "-c", "print('nothing')")), 0.1)).all()


@pytest.mark.slow
def test_every_program_receives(monkeypatch):
    monkeypatch.delenv(clients.CPP, raising=False)
    found = clients.run(clients.Settings(duration_s=1.0), Context(1))
    assert {"Python, abs_client", "Python, zenoh", "ROS 2's layout, abs-ros2"} <= found.values.keys()
    assert all(len(ages) > 10 and 0 < np.median(ages) < 5000 for ages in found.values.values())
    table = found.sections[0].blocks[0]
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == list(found.values)
