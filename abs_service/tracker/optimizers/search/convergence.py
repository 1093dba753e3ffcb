"""How a search by generations goes, and when it has converged."""

import numpy as np
from numpy.typing import NDArray

from calib.jit import kernel

#: Generations whose best costs must agree before a search counts as converged.
PATIENCE = 5


class Course:
    """The generations of one search.

    Args:
        generations: at most.
        tolerance: see `enter`.

    Attributes:
        least: best cost [nats] of every generation that is done, and room for the others (generations,).
        tolerance: see `enter`.
        done: how many generations are.
        steady: whether it has converged.
    """

    def __init__(self, generations: int, tolerance: float):
        self.least = np.empty(generations)
        self.tolerance = tolerance
        self.done = 0
        self.steady = False

    @property
    def left(self) -> int:
        """Generations that may follow."""
        return 0 if self.steady else len(self.least) - self.done

    def enter(self, costs: NDArray[np.float64]) -> None:
        """Takes the costs (population,) of the next generation."""
        self.steady = enter(costs, self.least, self.done, self.tolerance)
        self.done += 1


@kernel
def enter(costs: NDArray[np.float64], least: NDArray[np.float64], done: int, tolerance: float) -> bool:
    """Enters a generation; whether costs differ by little within it, and between the best of the last `PATIENCE`.

    Args:
        costs: of the generation (population,).
        least: best cost of every generation; that of this one is written.
        done: how many generations there were before.
        tolerance: by how much costs may differ [nats].
    """
    best = costs.min()
    least[done] = best
    if done + 1 < PATIENCE or costs.max() - best >= tolerance:
        return False
    last = least[done + 1 - PATIENCE : done + 1]
    return last.max() - last.min() < tolerance
