"""The heavy elastica, integrated from the free end, compared with beam theory and with another integration."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from abs_service.tracker.detection.strip.elastica import STEPS, heavy_elastica


@given(st.floats(-1.5, 1.5), st.floats(0.01, 60))
def test_it_is_what_an_adaptive_integration_gives(tip, load):
    def slopes(u, y):  # from the free end on
        return [-y[1], load * u * np.cos(y[0]), -np.cos(y[0]), -np.sin(y[0])]

    nodes = np.linspace(0, 1, STEPS + 1)
    phi, _, x, y = solve_ivp(slopes, (0, 1), [tip, 0, 0, 0], t_eval=nodes, rtol=1e-10, atol=1e-12).y[:, ::-1]
    found = heavy_elastica(tip, load)
    np.testing.assert_allclose(found.inclination[0], phi, rtol=0, atol=2e-5)
    np.testing.assert_allclose(found.points[0], np.stack([x - x[0], y - y[0]], axis=1), rtol=0, atol=2e-5)


def test_a_little_sag_is_that_of_the_cantilever():
    """Euler-Bernoulli beam: deflection w L⁴ / 8 D and slope w L³ / 6 D at the free end."""
    load = 1e-3
    shape = heavy_elastica(load / 6, load)
    assert shape.inclination[0, 0] == pytest.approx(0, abs=1e-8)
    assert shape.points[0, -1, 1] == pytest.approx(load / 8, rel=1e-4)


def test_shapes_do_not_know_each_other():
    together = heavy_elastica([0.2, 0.9], [1.0, 30.0])
    for k, (tip, load) in enumerate([(0.2, 1.0), (0.9, 30.0)]):
        np.testing.assert_array_equal(heavy_elastica(tip, load).points[0], together.points[k])
