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
        tolerance: see `is_steady`.

    Attributes:
        least: best cost [nats] of every generation that is done, and room for the others (generations,).
        tolerance: see `is_steady`.
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
        self.least[self.done] = costs.min()
        self.done += 1
        self.steady = is_steady(self.least, self.done, costs.max(), self.tolerance)


@kernel
def is_steady(least: NDArray[np.float64], done: int, most: float, tolerance: float) -> bool:
    """Whether costs differ by little, within the last generation and between the best ones of the last `PATIENCE`.

    Args:
        least: best cost of every generation.
        done: how many there are.
        most: worst cost of the last one.
        tolerance: by how much [nats].
    """
    if done < PATIENCE or most - least[done - 1] >= tolerance:
        return False
    last = least[done - PATIENCE : done]
    return last.max() - last.min() < tolerance
