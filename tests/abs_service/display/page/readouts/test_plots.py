"""Curves of the last minute."""

from dataclasses import replace

import numpy as np

from abs_service.display.page.numbers import Numbers
from abs_service.display.page.readouts.plots import COMPONENTS, STEPS, a_second, binned, complete, moving, plots


def numbers(t_s, theta, model_id="a", deviation_mm=0.5, lost=None) -> Numbers:
    return Numbers(
        t_s, 20.0, 10.0, 3, 0, {"tof": -1.0}, deviation_mm, model_id, np.array(theta, np.float32), lost or {}
    )


def test_the_components_that_move_most_are_shown_less_their_mean():
    thetas = [[1, 0.1 * i, 0, 0.2 * i, 0.3 * i, 0.4 * i, 0.5 * i, 0.6 * i] for i in range(3)]
    found = moving([numbers(i, theta) for i, theta in enumerate(thetas)])
    assert list(found) == ["Θ3", "Θ4", "Θ5", "Θ6", "Θ7"]
    assert len(found) == COMPONENTS
    np.testing.assert_allclose(found["Θ7"], [-0.6, 0, 0.6], atol=1e-6)


def test_thetas_of_another_model_are_left_out_of_the_curves():
    found = moving([numbers(0, [9.0, 9, 9], "old"), numbers(1, [1.0, 2.0]), numbers(2, [3.0, 2.0])])
    np.testing.assert_allclose(found["Θ0"], [np.nan, -1, 1])
    assert moving([]) == {}
    assert moving([numbers(0, [])]) == {}


def test_sigma_is_plotted_and_an_unknown_one_left_out():
    drawn = plots([numbers(9.6, [0.0], deviation_mm=np.nan), numbers(9.7, [0.0], deviation_mm=0.7)], {}, 10.0)
    assert drawn["σ of a vertex, median [mm]"]["σ"][-1] == 0.7
    assert drawn["latency [ms]"]["search"][-1] == 10.0
    assert drawn["log-likelihood of a vertex"]["tof"][-1] == -1.0


def test_ages_that_nobody_knows_as_those_of_a_replay_do_not_hide_the_search():
    replayed = replace(numbers(9.7, [0.0]), age_ms=float("nan"))
    drawn = plots([replayed], {}, 10.0)["latency [ms]"]
    assert [len(column) for column in complete(list(drawn.values()))] == [1, 1]
    assert drawn["search"][-1] == 10.0


def test_losses_are_plotted_by_component_as_what_came_between_two_estimates():
    given = [(7.2, 40), (7.7, 40), (8.2, 43), (8.7, 43), (9.2, 0), (9.7, 2)]  # the camera's process began anew
    drawn = plots([numbers(t_s, [0.0], lost={"capture": number, "record": 0}) for t_s, number in given], {}, 10.0)
    assert list(drawn["lost a second"]) == ["capture"]
    np.testing.assert_array_equal(drawn["lost a second"]["capture"][-6:], [np.nan, 0, 6, 0, 0, 4])


def test_sigma_of_followed_vertices_has_a_plot_of_its_own_while_there_are_some():
    title, numbers_now = "σ of the followed vertices [mm]", [numbers(9.7, [0.0])]
    assert title not in plots(numbers_now, {}, 10.0)
    assert plots(numbers_now, {"vertex 7": np.array([[9.6, 0.4], [9.7, 0.6]])}, 10.0)[title]["vertex 7"][-1] == 0.5


def test_without_losses_their_plot_says_zero():
    drawn = plots([numbers(9.2, [0.0]), numbers(9.7, [0.0])], {}, 10.0)
    assert drawn["lost a second"]["all"][-1] == 0


def test_bins_hold_means_and_rates_and_only_complete_ones_are_drawn():
    times_s = np.array([-0.4, -0.3, -1.2, -61.0])
    means = binned(times_s, [1.0, 3.0, 5.0, 7.0])
    assert len(means) == STEPS
    assert means[[-1, -3]].tolist() == [2.0, 5.0]
    assert np.isnan(means[-2])
    rates = a_second(times_s, np.ones(4))
    assert rates[[-1, -2]].tolist() == [4.0, 0.0]
    assert np.isnan(rates[:-2]).all()  # before the second half second nobody listened, or not all the time
    shown_s, values = complete([means])
    assert shown_s.tolist() == [-1.25, -0.25]
    assert values.tolist() == [5.0, 2.0]
