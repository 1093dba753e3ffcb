"""A texture that is rendered where it is read holds what the whole one does."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import DepthImage
from abs_service.tracker.synthesis.base import AS_MEASURED
from abs_service.tracker.synthesis.window import Bordered
from abs_service.tracker.terms.depth.texels import TexelsOnDemand, Unusable, WholeTexels
from calib.noise.tof_amplitude import TofAmplitude

NOISE = TofAmplitude(sigma=(1e-3, 2e-3), sigma_amplitude=0.5, mu=(3e-3,), mu_amplitude=0.4)
BORDER, BEYOND = (np.eye(8)[6].astype(np.float32) * cost for cost in (1.6, 4.5))
SHAPE = (14, 17)


def drawn(generator: np.random.Generator) -> DepthImage:
    distance, amplitude = generator.uniform(0.5, 2, SHAPE), generator.uniform(5, 500, SHAPE)
    distance[generator.random(SHAPE) < 0.2] = np.nan
    amplitude[generator.random(SHAPE) < 0.1] = np.nan
    return DepthImage(distance.astype(np.float32), amplitude.astype(np.float32))


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_single_candidates_and_populations_read_what_the_whole_texture_holds(seed):
    generator = np.random.default_rng(seed)
    whole = WholeTexels("tof", NOISE, Bordered(BORDER, BEYOND))
    on_demand = TexelsOnDemand(NOISE, Bordered(BORDER, BEYOND))
    for _ in range(3):  # of the frame before, nothing is left
        image, (top, left), scale = drawn(generator), generator.integers(0, 8, 2), generator.uniform(1, 3)
        window = slice(top, top + generator.integers(1, 6)), slice(left, left + generator.integers(1, 8))
        distance = whole.observe(image, window, scale, AS_MEASURED)
        np.testing.assert_array_equal(on_demand.observe(image, window, scale, AS_MEASURED), distance)
        known, chance = np.isfinite(distance), generator.random(distance.shape)
        free_m = np.where(chance < 0.2, chance, 0).astype(np.float32)
        unusable = Unusable((chance > 0.2) & (chance < 0.4), free_m, known & (chance > 0.4))
        if generator.random() < 0.8:  # else nothing was recognised
            assert on_demand.explain(unusable) == whole.explain(unusable)
        assert on_demand.shape == whole.shape == SHAPE
        inside = np.zeros((SHAPE[0] + 2, SHAPE[1] + 2), bool)
        inside[1:-1, 1:-1] = True
        some = generator.permutation(np.flatnonzero(inside))[:30].astype(np.int32)
        expected = whole.at(some[None])
        for pixel in (np.append(some, [-1, 0]).astype(np.int32)[None], np.tile(some, (2, 1))):
            np.testing.assert_array_equal(on_demand.at(pixel)[some], expected[some])
        np.testing.assert_array_equal(on_demand.at(np.zeros((2, 1), np.int32)), expected)
