"""Pixels that are copied when they are read are those of an image that is copied as a whole."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.synthesis.window import NOTHING_HAS
from abs_service.tracker.terms.photometric.copied_pixels import CopiedPixels

HEIGHT, WIDTH = 9, 12


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_samples_read_the_window_its_end_and_occluders(seed, as_levels):
    generator, pixels = np.random.default_rng(seed), CopiedPixels()
    for _ in range(3):  # of the frame before, nothing is left
        levels = generator.integers(0, 256, (HEIGHT, WIDTH, 3))
        picture = levels.astype(np.uint8) if as_levels else levels.astype(np.float32)
        top, left = generator.integers(HEIGHT - 2), generator.integers(WIDTH - 2)
        window = (
            slice(top, generator.integers(top + 1, HEIGHT + 1)),
            slice(left, generator.integers(left + 1, WIDTH + 1)),
        )
        covered = generator.random((HEIGHT, WIDTH)) < 0.3
        inside, expected = np.full((HEIGHT, WIDTH, 3), NOTHING_HAS), np.full((HEIGHT + 2, WIDTH + 2, 3), np.nan)
        inside[window] = picture[window]
        pixels.observe(picture, window)
        for is_covered in (False, True):
            if is_covered:
                inside[window] = np.where(covered[window][..., None], np.inf, picture[window])
                pixels.cover(covered)
            expected[1:-1, 1:-1] = inside
            for shape in ((1, 5), (2, 3), (1, 8), (4, 40)):
                pixel = generator.integers(-1, (HEIGHT + 2) * (WIDTH + 2), shape).astype(np.int32)
                seen = np.maximum(pixel, 0)
                np.testing.assert_array_equal(pixels.at(pixel)[seen], expected.reshape(-1, 3)[seen])
