"""Failures that nobody mends are told ever more rarely, and nothing else is."""

import logging

from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.repeats import MAX_TEXTS, Repeats, Tracebacks
from tests.abs_service.supervision.fake_processes import S, World, ends, passes

HOURS_S = 2 * 3600
TRACEBACK = ["Traceback (most recent call last):", '  File "x.py", line 3', "    f()", "    f()", "OSError: no disk"]


def test_a_process_that_never_works_fills_no_log(caplog):
    world = World()
    world.words = "abs-service: error: trackers.a.template: no file x.obj"
    supervisor = world.supervisor("capture", "track/a", "track/b", startup_ns=2 * HOURS_S * S)
    ends(world, supervisor, "track/a", -11)
    with caplog.at_level(logging.WARNING):
        while world.now_ns < HOURS_S * S:
            ends(world, supervisor, "track/a", Exit.USER)
            passes(world, supervisor, 2)
    lines = [record.message for record in caplog.records]
    assert supervisor.children["track/a"].restarts > 300
    assert 15 < len(lines) < 40, "one of each kind in ten minutes"
    assert "track/a ended with code 2: abs-service: error: trackers.a.template: no file x.obj" in lines[1]
    assert "more of these since the last one that was reported" in lines[-1]
    caplog.clear()
    world.words = "abs-service: error: another reason"
    ends(world, supervisor, "track/b", -11)
    ends(world, supervisor, "track/b", Exit.USER)
    assert len(caplog.records) == 2, "another failure is told at once"


def test_the_first_are_told_and_what_has_not_come_for_long_is_new():
    repeats = Repeats()
    assert [repeats.take(f"x ended: {t}", t * S) for t in range(7)] == [0, 0, 0, 0, 0, None, None]
    assert [repeats.take("x ended: 5", t * S) for t in (63, 65, 70, 180, 190)] == [None, 3, None, None, 2]
    assert repeats.take("x ended: 5", (190 + 2 * 240 + 1) * S) == 0
    assert repeats.take("y ended: 5", 0) == 0
    for number in range(2 * MAX_TEXTS):
        repeats.take("y" * number, 0)


def test_a_traceback_is_told_as_a_whole_and_ever_more_rarely():
    tracebacks = Tracebacks()

    def reported(lines, second, component="record"):
        return [reported for line in lines for reported in tracebacks.take(component, line, second * S)]

    assert reported(["a line", "a line"], 0) == ["a line", "a line"]
    for second in range(5):
        assert reported(TRACEBACK, second) == TRACEBACK
    assert reported([*TRACEBACK, "after it"], 6) == ["after it"]
    assert reported(TRACEBACK, 7, "capture") == TRACEBACK
    other = [*TRACEBACK[:-1], "KeyError: 3"]
    assert reported(other, 8) == other
    assert reported(TRACEBACK, 70)[-1] == "OSError: no disk (1 more of these since the last one that was reported)"
