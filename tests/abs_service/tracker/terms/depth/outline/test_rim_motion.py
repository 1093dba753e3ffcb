"""A slide and a turn of a mesh are told by all its edges; what lies against one side is no motion."""

import numpy as np
import pytest

from abs_service.tracker.terms.depth.outline.rim_motion import motion

ALONG = np.linspace(-30, 30, 15)
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
