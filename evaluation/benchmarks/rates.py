"""Time of whole frames at the paper's full budgets and with `hybrid`, and the share of it that is the search's own.

    NUMBA_NUM_THREADS=2 python -m evaluation.benchmarks.rates --frames 20 --rounds 3

prints JSON. Frames are those of the simulated sheet while it moves and bends, by 3 to 5 mm from frame to frame, from
frame set to estimate. The depth camera has 176 × 144 pixels, the colour camera 320 × 240. Frames do unequal work, so
the statistics are the median and the 95th percentile over the frames. All cases are measured in turns, and the round
with the least median is told: machines, and minutes on one machine, differ. Where other programs run as well, only the
processor time of one thread says something.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from abs_service.tracker.models import flexpad, nurbs
from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracker.optimizers.base import Budget, Optimizer, Problem, Search
from abs_service.tracker.posterior.curvature import Quadratic
from abs_service.tracking.plan import ModelSettings, OptimizerSettings
from abs_service.tracking.session import TrackingSession
from tests.abs_service.tracking.driving import default_plan, frame_set, rig_of, simulate

Answer = TypeVar("Answer")

#: The first exposure that is timed, the sheet moves by then; exposures on the way there, from the flat sheet at rest.
FIRST, APPROACH = 90, range(0, 90, 3)


@dataclass
class Clocked:
    """A problem, and the processor time of its answers [s]."""

    problem: Problem
    dimension: int
    spent_s: float = 0.0

    def linearize(self, theta: NDArray[np.float64]) -> Quadratic:
        """See `Problem`."""
        return self._clocked(lambda: self.problem.linearize(theta))

    def prior(self, theta: NDArray[np.float64]) -> Quadratic:
        """See `Problem`."""
        return self._clocked(lambda: self.problem.prior(theta))

    def outlier_share(self, theta: NDArray[np.float64]) -> float:
        """See `Problem`."""
        return self._clocked(lambda: self.problem.outlier_share(theta))

    def _clocked(self, ask: Callable[[], Answer]) -> Answer:
        begin = time.thread_time()
        answer = ask()
        self.spent_s += time.thread_time() - begin
        return answer


@dataclass
class Watched:
    """Settings of a search, and the processor time of every frame's search without costs and derivatives [s]."""

    settings: OptimizerSettings
    took_s: list[float] = field(default_factory=list)

    def build(self, dimension: int, generator: np.random.Generator) -> Optimizer:
        """The search, watched."""
        return WatchedSearch(self.settings.build(dimension, generator), self)


@dataclass
class WatchedSearch:
    """An `Optimizer` that measures the time between the costs that it receives and the candidates that it asks for."""

    search: Optimizer
    watched: Watched

    def follow(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Search:
        """See `Optimizer`."""
        clocked, own_s = Clocked(problem, problem.dimension), 0.0
        begin = time.thread_time()
        search = self.search.follow(clocked, start, budget)
        thetas = next(search)
        while True:
            own_s += time.thread_time() - begin
            costs = yield thetas
            begin = time.thread_time()
            try:
                thetas = search.send(costs)
            except StopIteration as ended:
                self.watched.took_s.append(own_s + time.thread_time() - begin - clocked.spent_s)
                return ended.value

    def explore(self, problem: Problem, start: NDArray[np.float64], budget: Budget) -> Search:
        """See `Optimizer`."""
        return self.search.explore(problem, start, budget)


@dataclass(frozen=True)
class Case:
    """Something to measure: a model, a search, about how many vertices, which sensors."""

    part: str
    model: ModelSettings
    optimizer: OptimizerSettings
    vertices: int = 300
    sensors: tuple[str, ...] = ("tof",)


def cases(scale: float) -> Iterator[Case]:
    """All cases, with generations multiplied by `scale`; none converges before its budget is spent."""
    sheet, pad, never = nurbs.Settings(control_points=(4, 4)), flexpad.Settings(), 1e-12
    for name, model, population, generations in (("FlexPad", pad, 16, 400), ("NURBS 4x4", sheet, 32, 1000)):
        budget = max(2, round(scale * generations))
        full = cma_es.Settings(population=population, generations=budget, tolerance=never)
        yield Case(f"{name}, {budget} x {population}, 300 vertices, depth", model, full)
        tenth = max(2, budget // 10)
        beside = cma.Settings(population=population, generations=tenth, tolerance=never)
        yield Case(f"{name}, {tenth} x {population} by pycma, 300 vertices, depth", model, beside)
    for vertices, sensors in ((400, ("tof",)), (1000, ("tof",)), (1000, ("tof", "color"))):
        seen = "depth + colour" if len(sensors) > 1 else "depth"
        yield Case(f"NURBS 4x4, hybrid, {vertices} vertices, {seen}", sheet, hybrid.Settings(), vertices, sensors)


def measure(case: Case, frames: int) -> dict[str, float]:
    """Milliseconds of a frame: median by the clock, median and 95th percentile of its thread's processor time.

    The search's share is its time without costs and derivatives by that of the whole frame, the median over the frames.
    """
    simulation = simulate("simulated://sheet?seed=1")
    rig = rig_of(simulation)
    rig = replace(rig, sensors={name: rig.sensors[name] for name in case.sensors})
    watched = Watched(case.optimizer)
    plan = default_plan(model=case.model, optimizer=watched, vertices=case.vertices, evaluations=10**9)
    tracking, took_s, worked_s = TrackingSession(rig, plan), [], []
    for k in (*APPROACH, *range(FIRST, FIRST + frames)):
        exposed = frame_set(simulation.expose(k)[0], k)
        began, begin = time.thread_time(), time.perf_counter()
        tracking.track(exposed, lambda: True)
        took_s.append(time.perf_counter() - begin)
        worked_s.append(time.thread_time() - began)
    assert tracking.mesh is not None, case
    clock_ms, cpu_ms = (1e3 * np.array(one[-frames:]) for one in (took_s, worked_s))
    return {
        "ms": float(np.median(clock_ms)),
        "cpu_ms": float(np.median(cpu_ms)),
        "cpu_p95_ms": float(np.quantile(cpu_ms, 0.95)),
        "search_share": float(np.median(1e3 * np.array(watched.took_s[-frames:]) / cpu_ms)),
    }


def main(arguments: list[str]) -> None:
    """Prints {part: {ms, cpu_ms, cpu_p95_ms, search_share}}."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    settings = parser.parse_args(arguments)
    rounds = [{case.part: measure(case, settings.frames) for case in cases(1.0)} for _ in range(settings.rounds)]
    quickest = {part: min((one[part] for one in rounds), key=lambda row: row["cpu_ms"]) for part in rounds[0]}
    print(json.dumps(quickest, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
