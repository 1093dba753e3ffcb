"""Depth images that are converted window by window are those that are converted at once."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from abs_service.pairing.images import DepthImage, Parts, Window

HEIGHT, WIDTH = 9, 12
PLACES = st.tuples(*(st.tuples(st.integers(0, n), st.integers(0, n)) for n in (HEIGHT, WIDTH)))


@given(st.lists(PLACES, max_size=6), st.booleans())
def test_windows_of_a_deferred_image_are_those_of_the_whole(places, ends_whole):
    whole = np.arange(2.0 * HEIGHT * WIDTH, dtype=np.float32).reshape(2, HEIGHT, WIDTH)
    asked = []

    def convert(window: Window) -> Parts:
        asked.append(window)
        return whole[0][window], whole[1][window]

    deferred, ready = DepthImage.deferred((HEIGHT, WIDTH), convert), DepthImage(*whole)
    for rows, columns in places:
        window = slice(*sorted(rows)), slice(*sorted(columns))
        for image in (deferred, ready, deferred):  # the last time, nothing is converted again
            for found, expected in zip(image.within(window), whole, strict=True):
                np.testing.assert_array_equal(found, expected[window])
    assert len(asked) <= len(places)
    if ends_whole:
        np.testing.assert_array_equal([deferred.distance, deferred.amplitude], whole)
    assert deferred.shape == ready.shape == (HEIGHT, WIDTH)
