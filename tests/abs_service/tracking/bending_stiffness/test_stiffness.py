"""The stiffness of a strip comes out of how it hangs: right, within what is stated, or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.detection.strip.strip_detection import Strip
from abs_service.tracker.models.gravity import Gravity
from abs_service.tracking.bending_stiffness.stiffness import (
    MIN_FRAMES,
    InclinationProfile,
    StiffnessError,
    estimate_stiffness,
    inclination_profile,
    predicted_tip,
)
from drivers.simulated.shapes.elastica import solve_elastica

SIGMA = 0.02
DOWN = np.array([0.0, 1.0, 0.0])
#: Leaves the gripper towards the camera and 0.6 rad below the horizontal; its side z looks up and to the camera.
T_RG = np.array(
    [
        [0.0, 1.0, 0.0, 0.02],
        [np.sin(0.6), 0.0, -np.cos(0.6), -0.1],
        [-np.cos(0.6), 0.0, -np.sin(0.6), 1.05],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
STRIP = Strip(T_RG, 0.3, 0.05, np.linspace(0, 0.4, 65), 0.004)


def frames(
    load: float, count: int = 80, segments: int = 4, sigma: float = SIGMA, seed: int = 0
) -> list[InclinationProfile]:
    """Noisy inclinations of the simulator's strips of length 1, whose gripper tilts."""
    generator = np.random.default_rng(seed)
    found = []
    for clamp in np.deg2rad(55 + 15 * np.sin(np.linspace(0, 6, count))):
        profile = solve_elastica(1.0, load, float(clamp))
        true = np.interp(np.linspace(0, 1, segments + 1), profile.s, np.pi / 2 - profile.angle)
        noisy = true + generator.normal(0, sigma, segments + 1)
        found.append(InclinationProfile(noisy, sigma**2 * np.eye(segments + 1)))
    return found


@settings(max_examples=15)
@given(st.floats(0.3, 40), st.integers(2, 8))
def test_the_load_is_found_within_its_deviation(load, segments):
    found = estimate_stiffness(frames(load, segments=segments), 1.0, 0.0, 0.0)
    assert abs(np.log(found.load / load)) < 4 * found.deviation
    assert found.deviation < 0.3
    assert found.misfit == pytest.approx(1, abs=0.4)
    assert found.frames == 80


def test_the_stated_deviation_is_that_of_many_trials():
    errors, stated = [], []
    for seed in range(30):
        found = estimate_stiffness(frames(4.0, 64, seed=seed), 1.0, 0.0, 0.0)
        errors.append(np.log(found.load / 4.0))
        stated.append(found.deviation)
    # Student's factor, and the larger one of two estimates, are on the safe side.
    assert 0.9 < np.mean(stated) / np.std(errors) < 1.8
    assert abs(np.mean(errors)) < np.mean(stated)


def test_a_nearly_straight_strip_sags_as_the_small_deflection_formula_says():
    """Horizontally clamped, the free end of a cantilever under its own weight inclines by w L³ / (6 D)."""
    load = 0.05
    inclination = load / 6 * (1 - (1 - np.linspace(0, 1, 5)) ** 3)
    found = estimate_stiffness([InclinationProfile(inclination, 1e-8 * np.eye(5))] * MIN_FRAMES, 1.0, 0.0, 0.0)
    assert found.load == pytest.approx(load, rel=0.01)
    assert found.bending(weight=2.0, length=1.0) == pytest.approx(2.0 / load, rel=0.01)


def test_an_unknown_length_and_the_first_frame_s_shape_are_parts_of_the_deviation():
    sure, unsure = (estimate_stiffness(frames(4.0), 0.3, *deviations) for deviations in ((0.0, 0.0), (0.003, 0.04)))
    assert (unsure.from_length, unsure.from_first) == (pytest.approx(0.03), 0.04)
    assert unsure.deviation == pytest.approx(np.hypot(sure.deviation, 0.05))


def test_a_strip_that_is_curved_by_itself_does_not_fit():
    curled = [
        InclinationProfile(frame.inclination + np.array([0, 0.3, 0, 0.3, 0]), frame.covariance) for frame in frames(4.0)
    ]
    assert estimate_stiffness(curled, 1.0, 0.0, 0.0).misfit > 9


def test_what_cannot_be_told_is_refused():
    with pytest.raises(StiffnessError, match=f"{MIN_FRAMES - 1} frames .* are too few, at least {MIN_FRAMES}"):
        estimate_stiffness(frames(4.0, MIN_FRAMES - 1), 1.0, 0.0, 0.0)
    straight = [InclinationProfile(np.full(5, 0.4), 1e-8 * np.eye(5))] * MIN_FRAMES
    with pytest.raises(StiffnessError, match="the strip bends too little"):
        estimate_stiffness(straight, 1.0, 0.0, 0.0)


def test_the_tip_that_goes_with_a_load_is_found():
    profile = solve_elastica(1.0, 4.0, 1.0)
    frame = InclinationProfile(np.interp(np.linspace(0, 1, 5), profile.s, np.pi / 2 - profile.angle), np.eye(5))
    assert predicted_tip(4.0, frame) == pytest.approx(np.pi / 2 - profile.angle[-1], abs=1e-3)


def test_the_covariance_of_inclinations_is_that_of_the_parameters():
    model = Gravity(STRIP, 4, True, 150, DOWN)
    generator = np.random.default_rng(1)
    half = generator.normal(size=(10, 10)) * 0.01
    covariance = half @ half.T
    theta = np.concatenate([[0.1, 0.05, -0.02, 0.01], generator.uniform(-0.1, 0.1, 6)])
    found = inclination_profile(model, theta, covariance)
    drawn = theta + generator.multivariate_normal(np.zeros(10), covariance, 4000)
    sampled = np.cov(np.array([model.inclination(one) for one in drawn]).T)
    np.testing.assert_allclose(found.covariance, sampled, atol=0.15 * np.abs(sampled).max())
    fixed = Gravity(STRIP, 4, False, 150, DOWN)
    held = inclination_profile(fixed, fixed.rest, 1e-4 * np.eye(4))
    assert np.linalg.eigvalsh(held.covariance).min() > 0  # nobody knows a gripper better than a little


def test_the_inclination_is_that_of_the_tangent_below_the_horizontal():
    model = Gravity(STRIP, 4, True, 150, DOWN)
    theta = np.concatenate([[0.1, 0.05, -0.02, 0.01], [0.1, 0.2, 0.0, 0.01, 0.02, 0.03]])
    inclination, T_rg = model.inclination(theta), model.T_rg(theta)
    assert inclination[0] == pytest.approx(np.arcsin(T_rg[1, 0]), abs=0.02)  # the gripper line is nearly level
    points = model.side_view(theta, model.deform(theta[None]).vertices[0].T.astype(float))
    first, last = np.argmin(points[:, 0]), np.argmax(points[:, 0])
    chord = points[last] - points[first]
    assert inclination.min() < np.arctan2(chord[1], chord[0]) < inclination.max()
    np.testing.assert_allclose(model.T_rg(model.rest), T_RG)
