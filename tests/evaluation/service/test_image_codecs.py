"""The experiment `image_codecs`: every codec returns what it was given, and recordings are measured as they are."""

import numpy as np
import pytest

from drivers.encoding.encoded_image import ImageCodec
from evaluation.service import image_codecs
from evaluation.service.image_codecs import candidates, images


@pytest.mark.parametrize("name", sorted(candidates.available()[0]))
@pytest.mark.parametrize(("shape", "dtype"), [((12, 16), "<u2"), ((12, 16, 3), "u1"), ((12, 16), "u1")])
def test_candidates_are_lossless(name, shape, dtype):
    pixels = np.random.default_rng(1).integers(0, 256, shape).astype(dtype)
    candidate = candidates.CANDIDATES[name]
    if candidate.applies(pixels):
        share, encode_s, decode_s = image_codecs.round_trip(candidate, pixels)
        assert 0.1 < share < 10  # of so few bytes, headers are the most
        assert encode_s >= 0
        assert decode_s >= 0


def test_a_recording_without_loss_is_smaller_than_one_of_raw_images():
    color = images.streams(images.simulated(1, 1))["simulated color/color"]
    raw = image_codecs.record((color,), ImageCodec.RAW, ImageCodec.RAW)
    lossless = image_codecs.record((color,), ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)
    assert 0.42 * raw.size < lossless.size < 0.6 * raw.size  # the noise's entropy, and what a prediction adds
    assert len(lossless.set_s) == 1
