"""The measured cases: the paper's full budgets, and `hybrid`."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from abs_service.tracker.models import flexpad, nurbs
from abs_service.tracker.optimizers import cma, cma_es, hybrid
from abs_service.tracking.plan import ModelSettings, OptimizerSettings


@dataclass(frozen=True)
class Case:
    """Something to measure.

    Attributes:
        part: what it is.
        model, optimizer: of the tracker.
        goal_ms: largest median time of a frame with one thread [ms]; NaN if there is no goal.
        vertices: about as many.
        sensors: of the demo rig.
    """

    part: str
    model: ModelSettings
    optimizer: OptimizerSettings
    goal_ms: float = math.nan
    vertices: int = 300
    sensors: tuple[str, ...] = ("tof",)


def cases(scale: float) -> Iterator[Case]:
    """All cases, with generations multiplied by `scale`; none converges before its budget is spent."""
    sheet, pad, never = nurbs.Settings(control_points=(4, 4)), flexpad.Settings(), 1e-12
    full = (("FlexPad", pad, 16, 400, 25.0), ("NURBS 4 × 4", sheet, 32, 1000, 100.0))
    for name, model, population, generations, goal_ms in full:
        budget = max(2, round(scale * generations))
        search = cma_es.Settings(population=population, generations=budget, tolerance=never)
        yield Case(f"{name}, {budget} × {population}, 300 vertices, depth", model, search, goal_ms)
        tenth = max(2, budget // 10)
        beside = cma.Settings(population=population, generations=tenth, tolerance=never)
        yield Case(f"{name}, {tenth} × {population} by pycma, 300 vertices, depth", model, beside)
    few = "NURBS 4 × 4, hybrid"
    yield Case(f"{few}, 400 vertices, depth", sheet, hybrid.Settings(), vertices=400)
    yield Case(f"{few}, 1000 vertices, depth", sheet, hybrid.Settings(), vertices=1000)
    both = ("tof", "color")
    yield Case(f"{few}, 1000 vertices, depth + colour", sheet, hybrid.Settings(), 5.0, 1000, both)
