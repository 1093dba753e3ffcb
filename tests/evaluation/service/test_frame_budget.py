"""The experiment `frame_budget`: times are those of the stages, functions are put back, and a short run."""

import types

import pytest

from evaluation.experiment import Context
from evaluation.service import frame_budget
from evaluation.service.frame_budget import Settings
from evaluation.service.frame_budget.stages import SEAMS, STAGES
from evaluation.service.frame_budget.stopwatch import Seam, Stopwatch


class Clock:
    """Nanoseconds that pass when told."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns

    def passes(self, ns: int) -> None:
        self.now_ns += ns


def test_what_a_stage_calls_of_another_one_counts_for_that_one() -> None:
    clock = Clock()
    program = types.SimpleNamespace(inner=lambda: clock.passes(5))

    def outer() -> str:
        clock.passes(1)
        program.inner()
        program.inner()
        clock.passes(2)
        return "done"

    program.outer = outer
    watch = Stopwatch(clock)
    with watch.watching((Seam("outside", program, "outer"), Seam("inside", program, "inner"))):
        clock.passes(100)
        assert program.outer() == "done"
        watch.lap()
        program.inner()
        watch.lap()
    assert watch.laps == [{"outside": 3, "inside": 10}, {"inside": 5}]


def test_functions_are_put_back_and_errors_pass() -> None:
    def broken() -> None:
        raise ValueError("broken")

    program = types.SimpleNamespace(run=broken)
    watch = Stopwatch(Clock())
    with pytest.raises(ValueError, match="broken"), watch.watching((Seam("run", program, "run"),)):
        program.run()
    assert program.run is broken


@pytest.mark.slow
def test_every_stage_of_a_frame_is_found_and_the_passes_agree() -> None:
    before = [vars(seam.owner)[seam.name] for seam in SEAMS]
    values = frame_budget.run(Settings(frames=8, live_s=0.0), Context(0)).values
    for head in ("tof", "structured_light"):
        assert set(STAGES) <= set(values[head]["cpu_ms"])
        assert values[head]["tracking"] == 1
        assert values[head]["thetas"] == values[head]["thetas_watched"]
    assert [vars(seam.owner)[seam.name] for seam in SEAMS] == before
