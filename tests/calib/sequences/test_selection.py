"""Static sequences: what moves is left out, planes and steps are found, and the parts of the error separated."""

import numpy as np
import pytest

from calib.noise.base import NoiseError
from calib.noise.constant import Constant
from calib.noise.fit.quality import Quality
from calib.sequences import parts, plane, plane_residuals, reference, stillness
from calib.sequences.candidates import Candidate, Level, of_image
from calib.sequences.reference import Kind
from calib.sequences.selection import Trial, attempt, choose, extremes
from calib.sequences.steps import Steps, recognize
from drivers.simulated.address import parse
from tests.calib.noise.models import MODELS, TOF
from tests.calib.sequences.walls import frames, sequence

RANDOM = np.random.default_rng
SMALL = "&tof=88x72"


def everywhere(static):
    return np.ones(static.mean.shape, bool)


def test_a_sheet_that_moves_is_left_out_and_the_wall_behind_it_is_not() -> None:
    uri = "simulated://sheet?sensors=structured_light&seed=2&speed=2"
    static, head = sequence(uri, 60, 90)
    simulation = parse(uri).build()
    swept = np.zeros(static.mean.shape, bool)
    for k in range(60, 90):
        u, v = np.moveaxis(head.camera.project(simulation.truths(k)[0].points_r), -1, 0)
        swept[int(v.min()) : int(v.max()) + 1, int(u.min()) : int(u.max()) + 1] = True
    assert static.still[~swept].mean() > 0.75  # the projector's shadow moves beside the sheet, and rims are left out
    inside = np.zeros_like(swept)
    rows, columns = np.nonzero(swept)
    inside[rows.min() + 30 : rows.max() - 29, columns.min() + 30 : columns.max() - 29] = True
    assert static.still[inside].mean() < 0.15
    z = 1.6
    expected = z**2 * np.sqrt(head.noise.random**2 + head.noise.step**2 / 12)
    middle = static.still & (np.abs(static.mean / static.rays[..., 2] ** -1 - z) < 0.05)
    assert np.sqrt(static.variance[middle].mean()) == pytest.approx(expected, rel=0.08)


def test_a_wall_at_rest_is_static_all_over_and_its_noise_is_the_law_s() -> None:
    static, head = sequence("simulated://wall?sensors=tof&distance=1.3&reflectivity=0.6&tilt=20" + SMALL, last=60)
    assert static.still.mean() > 0.99
    assert static.moving < 0.005
    law = head.noise.sigma(*head.ideal(()))
    assert np.sqrt(np.nanmean(static.variance / law**2)) == pytest.approx(1, abs=0.02)


def test_a_slow_drift_is_motion_although_every_step_of_it_is_lost_in_the_noise() -> None:
    generator = RANDOM(1)
    distance = 1 + 2e-3 * generator.standard_normal((30, 20, 30))
    distance[:, 5:15, 5:15] += np.linspace(0, 0.02, 30)[:, None, None]
    seen = stillness.look(distance, np.full_like(distance, np.nan), np.zeros((20, 30)))
    assert not seen.still[5:15, 5:15].any()
    assert seen.still[:, 20:].mean() > 0.95


def test_outliers_are_left_out_of_mean_and_variance() -> None:
    generator = RANDOM(2)
    distance = 1 + 2e-3 * generator.standard_normal((60, 20, 30))
    distance[generator.random(distance.shape) < 0.02] = 3.0
    seen = stillness.look(distance, np.full_like(distance, np.nan), np.zeros((20, 30)))
    assert seen.still.mean() > 0.9
    assert np.sqrt(seen.variance.mean()) == pytest.approx(2e-3, rel=0.05)
    assert np.abs(seen.mean - 1).max() < 2e-3


def test_frames_too_few_to_tell_noise_from_motion_are_refused() -> None:
    with pytest.raises(NoiseError, match="7 frames are too few"):
        stillness.segments(7)
    assert stillness.segments(100)[-1].stop == 100


def test_steps_of_a_disparity_are_told_from_digits() -> None:
    for distance in (1.2, 2.5):
        depths = [f.si() for f in frames(f"simulated://wall?sensors=structured_light&distance={distance}", 0, 30)[0]]
        steps = recognize(np.stack(depths), 0.001)
        assert steps.growth == pytest.approx(2.85e-3, rel=0.12)  # 4 or 5 digits of 1 mm are 4.1 mm
    static, _ = sequence("simulated://wall?sensors=tof&distance=1.5&tilt=30" + SMALL)
    assert static.steps == Steps(5 / 2**14, 0.0)
    assert recognize(np.full((9, 8, 8), np.nan), 0.0) == Steps()


@pytest.mark.parametrize("tilt", [-25.0, 0.0, 15.0])
def test_the_plane_of_a_wall_is_found_beside_something_else(tilt: float) -> None:
    static, _ = sequence(f"simulated://wall?sensors=tof&distance=1.3&tilt={tilt}" + SMALL)
    distance = static.mean.copy()
    distance[:30, :40] -= 0.2
    tolerance = np.full(distance.shape, 0.02)
    q, pixels = plane.find(distance, static.rays, static.still, tolerance, RANDOM(3))
    assert np.rad2deg(np.arctan2(q[0], q[2])) == pytest.approx(tilt, abs=0.1)
    assert 1 / q[2] == pytest.approx(1.3, abs=1e-3)
    assert not pixels[:29, :39].any()
    assert pixels[32:, 42:].mean() > 0.95


def test_a_common_offset_does_not_turn_a_target_at_a_known_distance() -> None:
    static, _ = sequence("simulated://wall?sensors=tof&distance=1.3&tilt=12&offset=0.05" + SMALL)
    found = reference.known(static, 1.3, everywhere(static), RANDOM(0))
    assert found.kind is Kind.KNOWN
    assert np.rad2deg(np.arctan2(found.plane[0], found.plane[2])) == pytest.approx(12, abs=0.3)
    assert np.nanmedian(static.mean - found.distance) == pytest.approx(0.05, abs=5e-4)


def test_temporal_fixed_and_systematic_part_are_told_apart() -> None:
    uri = "simulated://wall?sensors=tof&distance=1.2&reflectivity=0.8&offset=0.02&pattern=0.004" + SMALL
    static, head = sequence(uri, last=60)
    found = reference.known(static, 1.2, everywhere(static), RANDOM(0))
    separated = parts.separate(static, found, Constant(1.0, 0.02), static.still)
    law = np.sqrt(np.mean(np.square(head.noise.sigma(*head.ideal(())))))
    assert separated.temporal == pytest.approx(law, rel=0.03)
    assert separated.fixed == pytest.approx(0.004, rel=0.1)
    assert separated.offset == pytest.approx(0.02, abs=3e-4)
    shared, deviation = parts.pattern([static], [found], Constant(1.0, 0.02))
    assert np.nanstd(shared - head.pattern) < 1.5 * np.nanmedian(deviation)


def test_without_a_known_distance_there_is_no_offset_and_without_a_plane_no_fixed_pattern() -> None:
    static, _ = sequence("simulated://wall?sensors=tof&distance=1.2&offset=0.02" + SMALL)
    fitted = reference.fitted(static, everywhere(static), RANDOM(0))
    assert np.isnan(parts.separate(static, fitted, Constant(1.0), static.still).offset)
    assert np.isfinite(parts.separate(static, fitted, Constant(1.0), static.still).fixed)
    means = reference.mean(static, everywhere(static), RANDOM(0))
    assert np.isnan(parts.separate(static, means, Constant(1.0), static.still).fixed)


def test_an_error_that_hides_within_a_step_is_not_forgotten() -> None:
    """A sensor whose noise is a tenth of its steps repeats itself; it errs by the steps all the same."""
    generator, step = RANDOM(4), 0.01
    real = 1 + generator.uniform(0, 0.1, (40, 50))
    lengths = np.rint((real + 1e-3 * generator.standard_normal((30, 40, 50))) / step) * step
    seen = stillness.look(lengths, np.full_like(lengths, np.nan), np.full((40, 50), step))
    assert seen.still.mean() > 0.0
    static, _ = sequence(
        "simulated://wall?sensors=structured_light&noise=0.1&distance=2&tilt=30&structured_light=64x48"
    )
    means = reference.mean(static, everywhere(static), RANDOM(0))
    error = np.nanstd((static.distance - means.distance) / static.steps.at(static.mean))
    assert error == pytest.approx(1 / np.sqrt(12), rel=0.1)


def test_a_sensor_s_own_deviations_are_judged_by_local_planes() -> None:
    taken, head = frames("simulated://wall?sensors=tof&distance=1.1&tilt=25", 0, 1)
    reported_sigma = head.noise.sigma(*head.ideal(()))
    for factor, inside in ((1.0, 0.683), (2.0, 0.954)):
        z = plane_residuals.normalized(taken[0].si(), factor * reported_sigma, head.camera.rays())
        assert np.isfinite(z).mean() > 0.9
        assert np.mean(np.abs(z[np.isfinite(z)]) < 1) == pytest.approx(inside, abs=0.012)


def trial(coefficients: int, *scores: float) -> Trial:
    candidate = Candidate(str(coefficients), Level.IMAGE, coefficients, lambda _: TOF)
    return Trial(candidate, scores, Quality(0, 0, 0, 0, 0), "" if scores else "varies too little")


def test_the_simplest_model_is_chosen_that_none_is_clearly_better_than() -> None:
    poor, fair, rich = trial(1, 2.0, 2.1, 2.2), trial(3, 3.0, 3.1, 3.2), trial(9, 3.0, 3.1001, 3.2002)
    assert choose([poor, trial(2), fair, rich]) is fair
    assert choose([poor, fair, trial(9, 3.1, 3.2, 3.3)]).candidate.coefficients == 9
    with pytest.raises(NoiseError, match="varies too little"):
        choose([trial(2)])


def test_what_cannot_be_fitted_says_why() -> None:
    static, _ = sequence("simulated://wall?sensors=tof&noise=0&tof=32x24")
    from calib.sequences.evidence import gather

    found = [gather(static, reference.mean(static, everywhere(static), RANDOM(0)), slice(k, k + 10)) for k in (0, 10)]
    steep = next(one for one in of_image(True, True, Steps()) if "degrees 3 in x, 2 in a" in one.name)
    tried = attempt(steep, [found[0], found[1]], RANDOM(0))
    assert tried.scores == () or np.isfinite(tried.score)


@pytest.mark.parametrize("name", MODELS)
def test_outside_what_was_measured_every_model_is_positive_and_bounded(name: str) -> None:
    low, high, offset = extremes(MODELS[name], (0.01, 100.0), (0.0, 65535.0))
    # One says itself how its error grows with distance; the other repeats what its sensor claims, up to 100 m.
    bounds_m = {"structured_light": 50.0, "measured": 1000.0}
    assert 0 < low <= high < bounds_m.get(name, 0.5)
    assert offset < 0.2
