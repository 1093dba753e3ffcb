"""What an optimiser is: a search behind ask and tell, in coordinates where the curvature of the cost is about one."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Optimizer(Protocol):
    """A search for the minimum of a cost over ξ ∈ R^dim, frame after frame.

    Attributes:
        generations: how many generations a frame may take.
    """

    generations: int

    @property
    def deviation(self) -> float:
        """Current standard deviation of the candidates."""
        ...

    @property
    def mean(self) -> NDArray[np.float64]:
        """Centre (dim,) of the current distribution."""
        ...

    def restart(self) -> None:
        """Begins a frame at ξ = 0 with what the last frame taught about step size and covariance."""
        ...

    def ask(self) -> NDArray[np.float64]:
        """The next candidates (population, dim)."""
        ...

    def tell(self, candidates: NDArray[np.float64], costs: NDArray[np.float64]) -> None:
        """Learns the costs (population,) of the candidates that `ask` returned."""
        ...
