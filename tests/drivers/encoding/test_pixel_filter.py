"""Pixels survive compression bit for bit, in the format that the message's comment states."""

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from drivers.encoding import pixel_filter
from drivers.encoding.pixel_filter import Filter, PixelFilterError, Predictor
from tests.drivers.encoding.pixel_format import decode_plainly, encode_plainly


@st.composite
def images(draw):
    dtype = np.dtype(draw(st.sampled_from(["u1", "<u2", "<f4"])))
    size = draw(st.tuples(st.integers(1, 9), st.integers(1, 9)))
    form = draw(st.sampled_from(["plain", "mosaic", "color"])) if dtype.itemsize == 1 else "plain"
    shape = (*size, 3) if form == "color" else size
    raw = draw(hnp.arrays(f"<u{dtype.itemsize}", shape))  # NaN with any payload, for floating-point numbers
    return raw.view(dtype), form == "mosaic"


@given(images())
def test_pixels_return_bit_for_bit(image):
    pixels, mosaic = image
    chosen, data = pixel_filter.encode(pixels, mosaic)
    back = pixel_filter.decode(data, chosen, pixels.shape, pixels.dtype, mosaic)
    assert (back.dtype, back.shape) == (pixels.dtype, pixels.shape)
    assert back.tobytes() == pixels.tobytes()


@given(images())
def test_the_format_is_the_stated_one(image):
    pixels, mosaic = image
    chosen, data = pixel_filter.encode(pixels, mosaic)
    plain = decode_plainly(zstandard.decompress(data), chosen, pixels.shape, pixels.dtype.itemsize, mosaic)
    assert np.array_equal(plain, pixels.view(f"<u{pixels.dtype.itemsize}"))


@given(images(), st.sampled_from(Predictor), st.booleans())
def test_every_filter_is_undone(image, predictor, green_subtracted):
    pixels, mosaic = image
    chosen = Filter(predictor, green_subtracted and pixels.ndim == 3)
    data = zstandard.compress(encode_plainly(pixels, chosen, mosaic))
    assert pixel_filter.decode(data, chosen, pixels.shape, pixels.dtype, mosaic).tobytes() == pixels.tobytes()


def test_noise_takes_little_more_than_its_entropy():
    generator = np.random.default_rng(1)
    slope = np.add.outer(np.arange(240.0), np.arange(320.0))
    sigma = 20.0
    depth = np.rint(1000 + slope + generator.normal(0, sigma, slope.shape)).astype("<u2")
    _, data = pixel_filter.encode(depth, False)
    entropy_bits = np.log2(sigma * np.sqrt(2 * np.pi * np.e))
    difference_bits = entropy_bits + 0.5  # the difference of two samples has √2 of the deviation
    assert entropy_bits < 8 * len(data) / depth.size < difference_bits + 0.6


def test_the_green_channel_predicts_the_others_where_they_agree():
    generator = np.random.default_rng(1)
    grey = generator.integers(0, 256, (64, 64, 1), dtype="u1")
    colored, _ = pixel_filter.encode(generator.integers(0, 256, (64, 64, 3), dtype="u1"), False)
    alike, data = pixel_filter.encode(np.repeat(grey, 3, axis=2), False)
    assert alike.green_subtracted
    assert not colored.green_subtracted
    assert len(data) < 1.05 * grey.size


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "are no compressed pixels"),
        (b"\xff" * 40, "are no compressed pixels"),
        (zstandard.compress(bytes(11)), "12 bytes of pixels are expected, not 11"),
        (zstandard.compress(bytes(12))[:-3], "are no compressed pixels"),
    ],
)
def test_damaged_bytes_are_refused(data, complaint):
    with pytest.raises(PixelFilterError, match=complaint):
        pixel_filter.decode(data, Filter(Predictor.LEFT), (2, 3), np.dtype("<u2"), False)
