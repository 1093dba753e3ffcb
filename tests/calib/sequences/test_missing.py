"""Missing returns of targets: counted where the target is, of a simulator that loses what is too faint."""

import math

import numpy as np
import pytest

from calib.no_return import CAUTIOUS
from calib.sequences import reference
from calib.sequences.missing import learn
from tests.calib.sequences.walls import sequence

FAINT = "simulated://wall?sensors=tof&tof=64x48&reflectivity=0.2&tilt=30"


def test_what_is_too_faint_is_missing_where_the_wall_is_far_and_seen_from_aside() -> None:
    everywhere = np.ones((48, 64), np.bool_)
    statics = [sequence(f"{FAINT}&distance={depth}&seed={seed}")[0] for seed, depth in enumerate((0.8, 1.2, 1.6), 1)]
    references = [
        reference.known(static, depth, everywhere, np.random.default_rng(0))
        for static, depth in zip(statics, (0.8, 1.2, 1.6))
    ]
    found = learn(statics, references, [0.8, 1.2, 1.6], everywhere)
    assert len(found.targets) == 3
    for one, static in zip(found.targets, statics):
        assert np.all((one.cosine > 0) & (one.cosine <= 1))
        assert one.share.mean() <= 1 - static.returns.mean() / static.frames  # beyond the wall's hull, nothing is known
    near, _, far = found.targets
    assert near.share.mean() < 0.001
    assert far.share.mean() > 0.005
    predicted = [float(found.law.probability(one.distance, one.cosine).mean()) for one in found.targets]
    assert predicted[0] < predicted[2] == pytest.approx(far.share.mean(), rel=0.5)
    assert found.law.probability(1.6, 0.6) > found.law.probability(1.0, 1.0)


def test_without_a_target_nothing_is_told() -> None:
    static, _ = sequence(f"{FAINT}&distance=1.0")
    mean = reference.mean(static, np.ones((48, 64), np.bool_), np.random.default_rng(0))
    found = learn([static], [mean], [math.nan], np.ones((48, 64), np.bool_))
    assert (found.targets, found.law) == ((), CAUTIOUS)
