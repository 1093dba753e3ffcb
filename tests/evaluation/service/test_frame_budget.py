"""The experiment `frame_budget`: times are those of the stages, functions are put back, and a short run."""

import types
from pathlib import Path

import numpy as np
import pytest

from abs_service.config import load
from evaluation.experiment import Context
from evaluation.service import frame_budget
from evaluation.service.frame_budget import Settings, runs
from evaluation.service.frame_budget.errors import TrackedFrame, vertex_errors
from evaluation.service.frame_budget.live import Observed
from evaluation.service.frame_budget.rig import configuration
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


@pytest.mark.parametrize("seam", SEAMS, ids=lambda seam: f"{seam.stage}: {seam.name}")
def test_stages_begin_at_functions_that_exist(seam: Seam) -> None:
    assert callable(vars(seam.owner)[seam.name])


def plane(k: int) -> np.ndarray:
    """A flat surface that moves by 1 mm along z from exposure to exposure."""
    x, y = np.meshgrid(np.linspace(-0.1, 0.1, 5), np.linspace(-0.1, 0.1, 4))
    return np.stack([x, y, np.full_like(x, 1 + 1e-3 * k)], axis=-1).astype(np.float32)


def tracked(k: int, lag: float = 0.0, is_tracking: bool = True) -> TrackedFrame:
    """A frame whose vertices lag behind by so many exposures; the mesh was made from exposure 3."""
    place = np.array([[0.0, 0.0, 0.0], [0.05, 0.05, 0.0]])
    rest, moved = place + np.array([0, 0, 1.003]), place + np.array([0, 0, 1 + 1e-3 * (k - lag)])
    return TrackedFrame(is_tracking, moved, rest, 3)


def test_errors_are_those_of_the_same_exposure() -> None:
    found = vertex_errors({4: tracked(4), 9: tracked(9, lag=2.0)}, plane)
    assert found == {4: pytest.approx(0, abs=1e-3), 9: pytest.approx(2, abs=1e-3)}


def observed(frames: dict[int, TrackedFrame], lost: int = 0, counted: int = 0, rate_hz: float = 30.0) -> Observed:
    """A run with these frames."""
    return Observed(np.array([15.0, 16.0]), rate_hz, 0, lost, counted, 1.0, {"run": 0.1, "track": 0.3}, frames)


def test_goals_of_the_runs_can_fail() -> None:
    replay = {k: tracked(k, lag=1.0) for k in range(4, 10)}
    late = {**replay, 8: tracked(8, is_tracking=False)}
    seen = {
        runs.ALONE: observed({k: tracked(k, lag=2.0) for k in replay}, lost=3, counted=1),
        runs.BUSY: observed(late),
        runs.TWO: observed(replay, rate_hz=19.0),
        "60 Hz": observed(replay, rate_hz=58.0),
        "90 Hz": observed(replay, rate_hz=70.0),
    }
    goals = {goal.name: goal for goal in runs.goals(seen, replay, plane)}
    missed = {name: goal.value for name, goal in goals.items() if not goal.met}
    assert missed == {
        "Mean vertex error live, by that of the replay of the same exposures": pytest.approx(2, abs=0.01),
        "Frames that are not TRACKING beside one busy process, and are in the replay": 1,
        "Estimates with two cameras": 19.0,
        "Estimates with one camera at 90 Hz": 70.0,
        "Exposures in no estimate that no component counted, all runs": 2,
    }


@pytest.mark.parametrize(("cameras", "trackers"), [(1, 1), (2, 1), (1, 3)])
def test_the_rig_is_one_that_the_service_takes(tmp_path: Path, cameras: int, trackers: int) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(configuration("structured_light", ["simulated://sheet"] * cameras, trackers), encoding="utf-8")
    rig = load(path)
    assert len(rig.devices) == cameras
    assert [len(tracker.sensors) for tracker in rig.trackers.values()] == [2 * cameras] * trackers


@pytest.mark.slow
def test_every_stage_of_a_frame_is_found_and_the_passes_agree() -> None:
    before = [vars(seam.owner)[seam.name] for seam in SEAMS]
    values = frame_budget.run(Settings(frames=8, live_s=0.0, beside_s=0.0), Context(0)).values
    for head in ("tof", "structured_light"):
        assert set(STAGES) <= set(values[head]["cpu_ms"])
        assert values[head]["tracking"] == 1
        assert values[head]["thetas"] == values[head]["thetas_watched"]
    assert [vars(seam.owner)[seam.name] for seam in SEAMS] == before
