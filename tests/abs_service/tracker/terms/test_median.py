"""The median of a few numbers."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from abs_service.tracker.terms.median import median


@given(
    arrays.arrays(
        st.sampled_from([np.float32, np.float64]), st.integers(1, 30), elements=st.floats(-1e6, 1e6, width=32)
    )
)
def test_the_median_is_that_of_numpy(values):
    assert median(values) == np.median(values)
