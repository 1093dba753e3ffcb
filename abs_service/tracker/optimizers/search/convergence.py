"""Convergence of a search by generations."""

import numpy as np

from abs_service.tracker.optimizers.base import Costs

#: Generations whose minimum costs must agree before a search counts as converged.
PATIENCE = 5


class ConvergenceMonitor:
    """Stops a search whose costs agree within a generation, and whose minima agree over the last `PATIENCE`.

    Args:
        generations: maximum number of generations.
        tolerance: maximum difference of costs [nats].
    """

    def __init__(self, generations: int, tolerance: float):
        self._minima: list[float] = []
        self._generations = generations
        self._tolerance = tolerance
        self.converged = False

    @property
    def is_over(self) -> bool:
        """True if no generation may follow."""
        return self.converged or len(self._minima) >= self._generations

    def add(self, costs: Costs) -> None:
        """Adds the costs (population,) of a generation."""
        minimum = float(np.minimum.reduce(costs))  # a third of the time of `min`
        self._minima.append(minimum)
        recent = self._minima[-PATIENCE:]
        if len(recent) == PATIENCE and max(recent) - min(recent) < self._tolerance:
            self.converged = bool(costs.max() - minimum < self._tolerance)
