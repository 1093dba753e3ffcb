"""Time of whole frames at the paper's full budgets and with `hybrid`, and the search's own share of it.

    NUMBA_NUM_THREADS=2 python -m evaluation.benchmarks.rates --frames 20 --rounds 3

prints JSON. Frames are those of the simulated sheet, from frame set to estimate; the depth camera has 176 × 144 pixels,
the colour camera 320 × 240. All cases are measured in turn, and the round with the fastest frame is reported. Where
other programs run as well, only the CPU time of one thread is meaningful.

The generations of `cma_es` and the cost of its candidates are one compiled loop, so they cannot be timed separately.
Therefore the same number of candidates, distributed as at the start of the search, is evaluated again without a search;
the difference is the search's own time.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.fused_cost import NOTHING, Step
from abs_service.tracker.models import flexpad, nurbs
from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracker.optimizers.base import Budget, Optimizer, Outcome, Problem
from abs_service.tracker.posterior.curvature import Quadratic, search_metric
from abs_service.tracking.session import ModelSettings, OptimizerSettings, Tracking
from calib.jit import composed, kernel, prange
from tests.tracker.driving import default_plan, frame_set, rig_of, simulate

Answer = TypeVar("Answer")

#: The first exposure: the sheet is flat, as FlexPad wants it.
FIRST = 0


#: A cost in whose place `composed` puts a problem's.
judged: Callable[..., float] = NOTHING.kernel


@kernel
def _judge(thetas: NDArray[np.float64], times: int, arguments: tuple[Any, ...], costs: NDArray[np.float64]) -> None:
    for _ in range(times):
        for k in prange(len(thetas)):
            costs[k] = judged(thetas[k : k + 1], *arguments)


@dataclass
class Clocked:
    """A problem that adds up the time of its answers [s], except for costs evaluated in the search's compiled loop."""

    problem: Problem
    dimension: int
    spent_s: float = 0.0

    @property
    def judge(self) -> Step | None:
        return self.problem.judge

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._clocked(lambda: self.problem.cost(thetas))

    def linearize(self, theta: NDArray[np.float64]) -> Quadratic:
        return self._clocked(lambda: self.problem.linearize(theta))

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        return self._clocked(lambda: self.problem.prior(theta))

    def unexplained(self, theta: NDArray[np.float64]) -> float:
        return self._clocked(lambda: self.problem.unexplained(theta))

    def _clocked(self, ask: Callable[[], Answer]) -> Answer:
        begin = time.thread_time()
        answer = ask()
        self.spent_s += time.thread_time() - begin
        return answer


@dataclass
class Watched:
    """Settings of a search; of every frame its time without what others answered [s]; how to judge the last again."""

    settings: OptimizerSettings
    took_s: list[float] = field(default_factory=list)
    judge_again: Callable[[int], float] = lambda population: 0.0

    def build(self, dimension: int, generator: np.random.Generator) -> Optimizer:
        return WatchedSearch(self.settings.build(dimension, generator), self)


@dataclass
class WatchedSearch:
    """See `Watched`."""

    search: Optimizer
    watched: Watched

    def follow(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        clocked, begin = Clocked(problem, problem.dimension), time.thread_time()
        found = self.search.follow(clocked, start, budget)
        self.watched.took_s.append(time.thread_time() - begin - clocked.spent_s)
        self.watched.judge_again = partial(judging_s, problem, found.theta, budget.generations)
        return found

    def explore(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Outcome:
        return self.search.explore(problem, start, budget)


def judging_s(problem: Problem, theta: NDArray[np.float64], generations: int, population: int) -> float:
    """CPU time [s] to evaluate `generations` × `population` candidates around theta (dim,) without a search."""
    z = np.random.default_rng(1).standard_normal((population, problem.dimension))
    thetas = theta + z @ search_metric(problem.linearize(theta)).T
    step = problem.judge
    assert step is not None
    judge = composed(_judge, judged=step.kernel)
    begin = time.thread_time()
    judge(thetas, generations, step.arguments, np.empty(population))
    return time.thread_time() - begin


@dataclass(frozen=True)
class Case:
    """One measured configuration: model, search, approximate number of vertices, sensors."""

    part: str
    model: ModelSettings
    optimizer: OptimizerSettings
    vertices: int = 300
    sensors: tuple[str, ...] = ("tof",)
    in_one_loop: int = 0  # candidates per generation that are judged in the search's own loop


def cases(scale: float) -> Iterator[Case]:
    """All cases, with generations multiplied by `scale`; none converges before its budget is spent."""
    sheet, pad, never = nurbs.Settings(control_points=(4, 4)), flexpad.Settings(), 1e-12
    for name, model, population, generations in (("FlexPad", pad, 16, 400), ("NURBS 4x4", sheet, 32, 1000)):
        budget = max(2, round(scale * generations))
        full = cma_es.Settings(population=population, generations=budget, tolerance=never)
        yield Case(f"{name}, {budget} x {population}, 300 vertices, depth", model, full, in_one_loop=population)
        tenth = max(2, budget // 10)
        beside = cma.Settings(population=population, generations=tenth, tolerance=never)
        yield Case(f"{name}, {tenth} x {population} by pycma, 300 vertices, depth", model, beside)
    for vertices, sensors in ((400, ("tof",)), (1000, ("tof",)), (1000, ("tof", "color"))):
        seen = "depth + colour" if len(sensors) > 1 else "depth"
        yield Case(f"NURBS 4x4, hybrid, {vertices} vertices, {seen}", sheet, hybrid.Settings(), vertices, sensors)


def measure(case: Case, frames: int) -> dict[str, float]:
    """Least milliseconds of a frame, by the clock and of its thread's processor time, and the search's share of these.

    That is all but what the problem answered and judging takes, by the least of the frames, which do equal work.
    """
    simulation = simulate("simulated://sheet?seed=1")
    rig = rig_of(simulation)
    rig = replace(rig, sensors={name: rig.sensors[name] for name in case.sensors})
    watched = Watched(case.optimizer)
    plan = default_plan(model=case.model, optimizer=watched, vertices=case.vertices, evaluations=10**9)
    tracking, took_s, worked_s, judged_s = Tracking(rig, plan), [], [], []
    for k in range(FIRST, FIRST + frames + 3):
        exposed = frame_set(simulation.expose(k)[0], k)
        began, begin = time.thread_time(), time.perf_counter()
        tracking.track(exposed, lambda: True)
        took_s.append(time.perf_counter() - begin)
        worked_s.append(time.thread_time() - began)
        if k > FIRST:
            judged_s.append(watched.judge_again(case.in_one_loop) if case.in_one_loop else 0.0)
    assert tracking.mesh is not None, case
    own_s, least_s = min(watched.took_s[2:]) - min(judged_s[2:]), min(worked_s[3:])
    return {"ms": 1e3 * min(took_s[3:]), "cpu_ms": 1e3 * least_s, "search_share": own_s / least_s}


def main(arguments: list[str]) -> None:
    """Prints {part: {ms, cpu_ms, search_share}}."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    settings = parser.parse_args(arguments)
    rounds = [{case.part: measure(case, settings.frames) for case in cases(1.0)} for _ in range(settings.rounds)]
    quickest = {part: min((one[part] for one in rounds), key=lambda row: row["cpu_ms"]) for part in rounds[0]}
    print(json.dumps(quickest, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
