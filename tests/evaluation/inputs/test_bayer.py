"""A mosaic tracks a finely printed sheet in all four orders, and better than the same mosaic demosaiced."""

import numpy as np
import pytest

from abs_service.pairing.images import BAYER_ORDERS
from evaluation.inputs.bayer import CODES, VARIANTS, MosaicSequence, compare, select_sigmas

#: What the rule of the experiment chooses for every order and variant; see docs/explanation/colour.md.
SIGMA = 80.0


@pytest.mark.parametrize("order", BAYER_ORDERS)
def test_every_order_tracks(order: str) -> None:
    assert MosaicSequence(1, 6, order).track("direct", SIGMA).vertex_mm < 1.0


def test_the_only_deviation_to_choose_from_is_chosen_unseen() -> None:
    assert select_sigmas(MosaicSequence(1, 1), [SIGMA]) == dict.fromkeys(VARIANTS, SIGMA)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_direct_is_better_than_demosaiced() -> None:
    found = compare([MosaicSequence(seed, 60) for seed in (1, 2)], dict.fromkeys(VARIANTS, SIGMA))
    vertex_mm, along_mm = ({variant: float(np.mean(of[:, k])) for variant, of in found.items()} for k in (0, 1))
    for demosaiced in CODES:
        assert vertex_mm["direct"] < 0.98 * vertex_mm[demosaiced], vertex_mm
        assert along_mm["direct"] < 0.9 * along_mm[demosaiced], along_mm
