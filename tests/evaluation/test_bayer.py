"""A mosaic tracks a finely printed sheet in all four orders, and no worse than the same mosaic demosaiced."""

import numpy as np
import pytest

from abs_service.readers import BAYER_ORDERS
from tests.evaluation.bayer import Scene, compared

#: What the rule of the command chooses; see docs/colour.md.
SIGMAS = {"direct": 25.0, "bilinear": 20.0}


@pytest.mark.parametrize("order", BAYER_ORDERS)
def test_every_order_tracks(order):
    assert Scene(1, 8, order).track("direct", SIGMAS["direct"]).vertex_mm < 1.0


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_direct_is_not_worse_than_bilinear():
    found = compared([Scene(seed, 45) for seed in (1, 2)], SIGMAS)
    vertex_mm = {variant: float(np.mean(results[:, 0])) for variant, results in found.items()}
    assert vertex_mm["direct"] < 1.02 * vertex_mm["bilinear"], vertex_mm
