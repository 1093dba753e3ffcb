"""The outline's deviation follows how far its edges wander; a slide, a turn and what is usual change nothing."""

import numpy as np
import pytest

from abs_service.tracker.terms.depth.outline.raggedness import SHARE, TYPICAL_PX, Raggedness
from abs_service.tracker.terms.depth.outline.rim import Rim
from abs_service.tracker.terms.depth.outline.rim_outline import RimOutline
from tests.abs_service.tracker.terms.depth.outline.outline_scene import CAMERA, MESH, look, moved, picture
from tests.abs_service.tracker.terms.depth.outline.test_rim_motion import OUT, PLACES, off


def after(away: list[np.ndarray], minimum: float = 0.5, maximum: float = 3.0) -> Raggedness:
    """Raggedness of an outline after frames with such distances of its edges."""
    ragged = Raggedness(minimum, maximum)
    for frame in away:
        ragged.update(frame, OUT, PLACES)
    return ragged


def wandering(px: float, frames: int = 60, seed: int = 1) -> list[np.ndarray]:
    """Distances of the edges that wander by so much."""
    return list(np.random.default_rng(seed).normal(0, px, (frames, len(OUT))))


@pytest.mark.parametrize("seed", range(3))
def test_edges_that_wander_widen_the_outline(seed):
    ragged = after(wandering(4.0, seed=seed))
    assert ragged.deviation == pytest.approx(np.sqrt(0.5**2 + SHARE**2 * (4.0**2 - TYPICAL_PX**2)), rel=0.15)
    assert ragged.off_px == pytest.approx(8.0, rel=0.15)


@pytest.mark.parametrize("away", [wandering(1.2), [off((5.0, 2.0))] * 60, [off(turn=0.2)] * 60])
def test_what_is_usual_and_a_motion_of_the_mesh_do_not(away):
    assert after(away).deviation == 0.5


def test_a_deviation_that_is_given_stays():
    ragged = after(wandering(4.0), 0.7, 0.7)
    assert (ragged.deviation, ragged.off_px) == (0.7, 0.0)


@pytest.mark.parametrize("near", [7, 29])
def test_few_edges_and_an_outline_that_is_elsewhere_tell_nothing(near):
    """Something hides the object, or the mesh is lost: most edges are far from what seems to be its outline."""
    wander = np.random.default_rng(1).normal(0, 4.0, len(OUT)).clip(-7, 7)
    elsewhere = np.where(np.arange(len(OUT)) < near, wander, -np.inf)
    unknown = np.where(np.arange(len(OUT)) < 7, wander, np.nan)
    for away in (elsewhere, unknown):
        ragged = after([away] * 60)
        assert (ragged.deviation, ragged.off_px) == (0.5, 0.0)


def frayed(generator: np.random.Generator) -> np.ndarray:
    """The sheet with stripes of 10 rows and columns that are displaced by 5 px, anew in every picture."""
    image = picture()
    for _ in range(2):
        shifts = np.repeat(generator.normal(0, 5.0, len(image) // 10).round().astype(int), 10)
        image = np.stack([np.roll(row, shift) for row, shift in zip(image, shifts)]).T
    return np.ascontiguousarray(image)


def test_a_frayed_outline_holds_the_mesh_less_and_its_edges_are_not_off():
    steady, wide = (RimOutline(CAMERA, Rim.of(MESH), 0.5, ragged) for ragged in (0.5, 3.0))
    generator = np.random.default_rng(3)
    off_outline = np.zeros(2)
    for distance in [picture(), *(frayed(generator) for _ in range(40))]:
        fits = [look(term, distance).fit(moved(MESH, 0.0)) for term in (steady, wide)]
        off_outline += [fit.outside + fit.inside for fit in fits]
    assert off_outline[1] < 0.9 * off_outline[0]
    costs = []
    for term in (steady, wide):
        seen = look(term, picture())
        costs.append(seen.cost(moved(MESH, 6e-3))[0] - seen.cost(moved(MESH, 0.0))[0])
    assert 0 < costs[1] < costs[0] / 2
