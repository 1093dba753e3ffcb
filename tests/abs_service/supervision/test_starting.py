"""A process that starts or compiles may be silent, but not stand still."""

import pytest

from abs_service.supervision.children.child_process import ThreadTimes
from tests.abs_service.supervision.fake_processes import S, World, passes


@pytest.fixture
def world():
    return World()


def test_a_child_that_starts_or_compiles_may_be_silent_for_longer(world):
    supervisor = world.supervisor("track/a")
    passes(world, supervisor, 170)
    supervisor.heartbeat("track/a", busy=True)
    passes(world, supervisor, 170)
    assert (world.events, supervisor.children["track/a"].reason) == ([], "")


@pytest.mark.parametrize("received", [True, False])
def test_a_child_that_stands_still_while_it_starts_or_compiles_is_told_and_killed_long_before_that(world, received):
    supervisor = world.supervisor("track/a")
    child, process = supervisor.children["track/a"], world.latest("track/a")
    for second in range(60):
        process.its_threads = {1: ThreadTimes(ran_ns=second * S)}
        if received:
            supervisor.heartbeat("track/a", busy=True)
        passes(world, supervisor, 1)
    assert (world.events, child.reason) == ([], "")
    passes(world, supervisor, 1)
    assert "no health for" in child.reason, "the last look saw that it had run"
    passes(world, supervisor, 10)
    assert ("kill", "track/a") in world.events
