"""Time of one generation of CMA-ES, ask and tell, by population and dimension; see docs/decisions/0008."""

import numpy as np
import pytest

from abs_service.tracker.optimizers.cma import PycmaSampler
from abs_service.tracker.optimizers.cma_es import CmaEsSampler


@pytest.mark.parametrize(("dimension", "population"), [(15, 16), (48, 32), (108, 40)])
@pytest.mark.parametrize("strategy", [PycmaSampler, CmaEsSampler], ids=["cma", "cma_es"])
def test_ask_and_tell(benchmark, strategy, dimension, population):
    search = strategy(dimension, np.random.default_rng(1), 0.5, population, 0.5)
    costs = np.sum((search.ask() * np.geomspace(1, 10, dimension)) ** 2, axis=1)

    def generation():
        search.ask()
        search.tell(costs)

    benchmark.pedantic(generation, rounds=1 if benchmark.disabled else 300, warmup_rounds=1)
    assert np.isfinite(search.mean).all()
