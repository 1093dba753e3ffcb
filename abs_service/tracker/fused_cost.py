"""The way of every candidate from Θ to its cost in one compiled loop, whose threads part only once.

Models, priors and sensors are kernels of their own. Here they are joined to one that deforms a candidate's mesh, lets
everything that has something to say about it do so, and goes on to the next one: what one step writes is in the fastest
cache when the next one reads it, and the interpreter calls once for all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.jit import composed, kernel, prange


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What a part does for one candidate at a time.

    Attributes:
        kernel: if it deforms, it takes parameters (1, dim) and returns vertices and normals as in `Surface`; if it
            judges, it takes parameters, vertices and normals and returns a cost. Those of parts of these, such as a
            view's, and a chain's, say themselves what they take.
        arguments: arrays and numbers that the kernel takes after these; no tuples.
    """

    kernel: Callable[..., Any]
    arguments: tuple[Any, ...] = ()


def step_of(part: object) -> Step | None:
    """What a part does with the observation in hand, if it can tell it as a step, which not every part needs to."""
    step = getattr(part, "step", None)
    return step() if step else None


class Chain:
    """All that a posterior consists of: how the surface is made, what the priors and the measurements say of it.

    Attributes:
        judge: what one candidate costs: a step that takes parameters (1, dim) only.
    """

    def __init__(self, model: Step, stretch: Step, shape: Step, motion: Step, objective: Step):
        steps = {"deform": model, "stretch": stretch, "shape": shape, "motion": motion, "objective": objective}
        kernels = {name: step.kernel for name, step in steps.items()}
        deformed, stretched, shaped, moved, _ = np.cumsum([len(step.arguments) for step in steps.values()]).tolist()
        parts = {**kernels, "DEFORMED": deformed, "STRETCHED": stretched, "SHAPED": shaped, "MOVED": moved}
        self.judge = Step(composed(_judged, **parts), sum((step.arguments for step in steps.values()), ()))
        self._kernel = composed(_cost, **parts)

    def cost(self, thetas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost (population,) of parameters (population, dim)."""
        out = np.empty(len(thetas))
        self._kernel(thetas, self.judge.arguments, out)
        return out


def both(first: Step, second: Step) -> Step:
    """A judging step: the sum of two."""
    if second is NOTHING:
        return first
    kernel = composed(_both, cost=first.kernel, other=second.kernel, FIRST=len(first.arguments))
    return Step(kernel, first.arguments + second.arguments)


def available(steps: Sequence[tuple[bool, Step]]) -> Step:
    """A judging step: the sum of those that are available, one kernel whichever these are.

    Every level of what is composed is compiled with all that is below it, so there are as few as possible.
    """
    return reduce(_and, reversed(steps), NOTHING)


def _and(others: Step, one: tuple[bool, Step]) -> Step:
    is_available, step = one
    kernel = composed(_available, cost=step.kernel, other=others.kernel, FIRST=len(step.arguments))
    return Step(kernel, (is_available, *step.arguments, *others.arguments))


def deforming(fill: Callable[..., Any], vertices: int, arguments: tuple[Any, ...]) -> Step:
    """A deforming step.

    Args:
        fill: a kernel that takes parameters (1, dim), `arguments`, and arrays (1, 3, n) for vertices and normals.
        vertices: their number n.
        arguments: what it takes.
    """
    return Step(composed(_deformed, fill=fill), (vertices, *arguments))


@kernel
def _nowhere(thetas: NDArray[np.float64], vertices: NDArray[np.float32], normals: NDArray[np.float32]) -> None:
    """A surface in whose place `composed` puts another."""
    vertices[:], normals[:] = 0, 0


fill: Callable[..., None] = _nowhere


@kernel
def _deformed(
    thetas: NDArray[np.float64], count: int, *arguments: Any
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """See `deforming`."""
    vertices, normals = np.empty((1, 3, count), np.float32), np.empty((1, 3, count), np.float32)
    fill(thetas, *arguments, vertices, normals)
    return vertices, normals


#: A step that deforms.
deform: Callable[..., Any] = _deformed


@kernel
def cost(thetas: NDArray[np.float64], vertices: NDArray[np.float32], normals: NDArray[np.float32]) -> float:
    """What has nothing to say costs nothing."""
    return 0.0


#: A judging step that has nothing to say.
NOTHING = Step(cost)

other = stretch = shape = motion = objective = cost

#: Where the arguments of the first of two steps end, or of each step of a chain.
FIRST = DEFORMED = STRETCHED = SHAPED = MOVED = 0


@kernel
def _both(
    thetas: NDArray[np.float64], vertices: NDArray[np.float32], normals: NDArray[np.float32], *arguments: Any
) -> float:
    """See `both`."""
    first = cost(thetas, vertices, normals, *arguments[:FIRST])
    return first + other(thetas, vertices, normals, *arguments[FIRST:])


@kernel
def _available(
    thetas: NDArray[np.float64],
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    is_available: bool,
    *arguments: Any,
) -> float:
    """See `available`."""
    first = cost(thetas, vertices, normals, *arguments[:FIRST]) if is_available else 0.0
    return first + other(thetas, vertices, normals, *arguments[FIRST:])


@kernel
def _judged(theta: NDArray[np.float64], *arguments: Any) -> float:
    """What parameters (1, dim) cost."""
    vertices, normals = deform(theta, *arguments[:DEFORMED])
    priors = stretch(theta, vertices, normals, *arguments[DEFORMED:STRETCHED])
    priors += shape(theta, vertices, normals, *arguments[STRETCHED:SHAPED])
    priors += motion(theta, vertices, normals, *arguments[SHAPED:MOVED])
    return priors + objective(theta, vertices, normals, *arguments[MOVED:])


@kernel
def _cost(thetas: NDArray[np.float64], arguments: tuple[Any, ...], out: NDArray[np.float64]) -> None:
    """See `Chain.cost`. What `_judged` does is written again: as a level of its own, it would be compiled twice."""
    for k in prange(len(thetas)):
        theta = thetas[k : k + 1]
        vertices, normals = deform(theta, *arguments[:DEFORMED])
        priors = stretch(theta, vertices, normals, *arguments[DEFORMED:STRETCHED])
        priors += shape(theta, vertices, normals, *arguments[STRETCHED:SHAPED])
        priors += motion(theta, vertices, normals, *arguments[SHAPED:MOVED])
        out[k] = priors + objective(theta, vertices, normals, *arguments[MOVED:])
