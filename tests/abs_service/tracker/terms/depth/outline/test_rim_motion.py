"""A slide and a turn of a mesh are told by all its edges; what lies against one side is no motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from abs_service.tracker.terms.depth.outline.rim_motion import displacement, motion, shown_by, without_motion

ALONG = np.linspace(-30, 30, 15)
#: Least distance of an edge outside the outline if nothing tells how far [m].
BEYOND_M = 0.004
#: Edges of a square of 60 pixels: places and directions out of it, right, down, left and up.
PLACES = 100 + np.concatenate([
    np.stack([np.full(15, 30), ALONG], axis=1), np.stack([ALONG, np.full(15, 30)], axis=1),
    np.stack([np.full(15, -30), ALONG], axis=1), np.stack([ALONG, np.full(15, -30)], axis=1),
])  # fmt: skip
OUT = np.repeat([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]], 15, axis=0)


def off(slide: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> np.ndarray:
    """Distances of the edges from the outline of an object that moved by so much [px], [rad]."""
    x, y = (PLACES - 100).T
    moved = np.array(slide) + turn * np.stack([-y, x], axis=1)
    return np.einsum("ki,ki->k", OUT, moved)


def test_the_motion_is_found_with_noise_and_bounded_distances():
    noise = 0.4 * np.random.default_rng(1).standard_normal(60)
    for slide, turn, expected in (((3.0, 0.0), 0.0, 3.0), ((1.0, -2.0), 0.0, 5**0.5), ((0.0, 0.0), 0.1, 3.4)):
        assert motion(off(slide, turn), OUT, PLACES) == pytest.approx(expected, rel=0.05)
        assert motion(np.clip(off(slide, turn) + noise, -4, 4), OUT, PLACES) == pytest.approx(expected, rel=0.15)


def test_noise_and_what_lies_against_a_side_and_a_few_edges_are_no_motion():
    assert motion(0.4 * np.random.default_rng(2).standard_normal(60), OUT, PLACES) == 0
    for sides in ((0,), (1,), (0, 2), (0, 1, 2, 3)):
        against = np.where(np.isin(np.arange(60) // 15, sides), 4.0, 0.0)
        assert motion(against, OUT, PLACES) == 0
    assert motion(off((3.0, 0.0))[:7], OUT[:7], PLACES[:7]) == 0
    assert motion(np.zeros(60), OUT, PLACES) == 0
    assert motion(off((1.9, 0.0)), OUT, PLACES) == 0  # as mixed pixels may show


def test_edges_show_no_motion_along_the_outline():
    """Nine edges on a sixth of a circle, and on a straight side: half a pixel off, as by mixed pixels, is no motion."""
    angle = np.linspace(-0.5, 0.5, 9)
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    off_by = 0.5 * np.sign(np.arange(9) - 3.5)
    for seed in range(20):
        out = arc + 0.05 * np.random.default_rng(seed).standard_normal((9, 2))  # directions of a mesh's edges are rough
        assert motion(off_by, out, 100 + 20 * arc) == 0
        assert motion(off_by, out - arc + OUT[:9], PLACES[:9]) == 0
        assert motion(3 * arc[:, 0], out, 100 + 20 * arc) == pytest.approx(3, rel=0.1)  # a slide across it is one


def test_a_slide_is_what_opposite_sides_agree_on():
    right, left, down = (np.tile(direction, (10, 1)) for direction in ((1.0, 0.1), (-1.0, 0.1), (0.1, 1.0)))
    directions = np.concatenate([right, left, down])
    slid = np.repeat([0.03, -0.02, 0.0], 10)
    assert displacement(slid, directions, BEYOND_M) == pytest.approx(0.02)
    leant_against = np.repeat([0.03, 0.0, 0.0], 10)
    assert displacement(leant_against, directions, BEYOND_M) == pytest.approx(0.01)  # the mean of all
    held_by_two_hands = np.repeat([0.03, 0.03, 0.0], 10)
    assert displacement(held_by_two_hands, directions, BEYOND_M) == pytest.approx(0.02)


def test_one_side_tells_a_slide_if_the_opposite_one_is_out_of_sight():
    right, down = np.tile([1.0, 0.1], (10, 1)), np.tile([0.1, 1.0], (30, 1))
    directions = np.concatenate([right, down])
    assert displacement(np.repeat([0.03, 0.0], [10, 30]), directions, BEYOND_M) == 0.03
    few_of_it = np.repeat([0.03, 0.0], [4, 36])
    assert displacement(few_of_it, directions, BEYOND_M) == pytest.approx(0.003)
    assert displacement(np.full(5, 0.03), right[:5], BEYOND_M) == pytest.approx(0.03)
    assert displacement(np.zeros(0), np.zeros((0, 2)), BEYOND_M) == 0


def strip(turn: float, left: list[float], right: list[float]) -> float:
    """Displacement of a strip with 60 edges along each side on the outline, and with few at its ends [m]."""
    long = [[0.0, 1.0], [0.0, -1.0]] * 60
    directions = np.array([*long, *[[-1.0, 0.1]] * len(left), *[[1.0, -0.1]] * len(right)])
    turned = directions @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return displacement(np.array([*np.zeros(120), *left, *right]), turned, BEYOND_M)


def test_the_ends_of_a_strip_tell_that_it_has_slid_however_it_lies():
    """A belt that waved was TRACKING with a mesh that had slid by five widths: its ends had three and two edges."""
    for turn in np.linspace(0, 2 * np.pi, 17):
        assert strip(turn, [0.013, 0.02, 0.014], [-np.inf, -np.inf]) == pytest.approx(0.013)
        assert strip(turn, [0.03, 0.03], [-0.01, -0.02]) == pytest.approx(0.01)
        for held in ([0.013, 0.02, 0.0], [0.03]):  # an edge in its place contradicts, and one alone tells nothing
            assert strip(turn, held, [-np.inf, -np.inf]) < 0.002
        assert strip(turn, [0.03, 0.03, 0.03], [0.03, 0.03]) < 0.002  # two hands hold it


def test_far_outside_counts_as_least_as_far_as_is_known():
    sides = np.repeat([[1.0, 0.0], [-1.0, 0.0]], 10, axis=0)
    assert displacement(np.repeat([0.02, -np.inf], 10), sides, BEYOND_M) == pytest.approx(0.02)
    assert displacement(np.full(10, -np.inf), sides[:10], BEYOND_M) == pytest.approx(BEYOND_M)


@given(st.integers(0, 2**32 - 1), st.integers(8, 40), st.booleans())
def test_the_motion_is_that_of_least_squares(seed: int, count: int, is_strip: bool):
    """Edges of a strip show no motion along it."""
    generator = np.random.default_rng(seed)
    places, angles = generator.uniform(0, 200, (count, 2)), generator.uniform(0, 7, count)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1) * ((0, 1) if is_strip else (1, 1))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    arms = places - places.mean(axis=0)
    rows = shown_by(directions, arms)
    away = rows @ (*generator.normal(0, 4, 2), generator.normal(0, 0.05)) + generator.normal(0, 0.3, count)
    left = away - rows @ np.linalg.lstsq(rows, away)[0]
    np.testing.assert_allclose(without_motion(away, directions, places), left, atol=1e-9)
    reach = np.sqrt(np.mean(np.sum(arms**2, axis=1)))
    shown_as, sizes, motions = np.linalg.svd(shown_by(directions, arms / reach), full_matrices=False)
    shown = sizes >= 0.25 * np.sqrt(count)
    parts = (away @ shown_as)[shown]
    along, across, turn = (parts / sizes[shown]) @ motions[shown]
    x, y = arms.T / reach
    length = np.median(np.hypot(along - turn * y, across + turn * x))
    counts = parts @ parts > 0.7 * (away @ away) and length > 2
    assert motion(away, directions, places) == pytest.approx(length if counts else 0.0)
