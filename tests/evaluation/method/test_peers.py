"""The comparison with peers: scene, baseline, and our tracker on a short sequence."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import KDTree

from evaluation.method import peers
from evaluation.method.peers.competitors import KNOWN, NoTracking, installed
from evaluation.method.peers.gauss_newton import GaussNewton
from evaluation.method.peers.measuring import track_frames, with_template
from evaluation.method.peers.own_trackers import SETUPS, OwnTracker
from evaluation.scenes.bent_sheet import (
    CAMERA,
    SIDE,
    SIZE,
    SheetScene,
    SheetState,
    places,
    render_frames,
    spin,
    swing,
)
from tests.reference import gauss_newton as plain_form

KINDS = (GaussNewton, plain_form.GaussNewton)


@pytest.mark.parametrize("degrees", [-120, -1, 0, 1e-6, 60, 120])
def test_the_sheet_bends_without_stretching(degrees: float):
    grid = places(61, 41)
    points = SheetState(np.deg2rad(degrees), (0.2, -0.3, 0.1), (0.0, 0.1, 1.0)).points(grid)
    along, across = (np.linalg.norm(np.diff(points, axis=axis), axis=-1).sum(axis=axis) for axis in (1, 0))
    np.testing.assert_allclose(along, SIZE[0], rtol=5e-4)  # 60 chords of an arc
    np.testing.assert_allclose(across, SIZE[1], rtol=1e-9)


def test_a_shot_measures_the_sheet_where_it_is():
    frame = render_frames(SheetScene("quiet", sigma=1e-6), [10], np.random.default_rng(1))[0]
    assert 1400 < np.count_nonzero(frame.sheet) < 2000  # as in the sequences that the goals come from
    columns, rows = np.floor(CAMERA.project(frame.state.points(places(9, 7) * 0.9)).reshape(-1, 2).T + 0.5).astype(int)
    assert frame.sheet[rows, columns].all()
    fine = frame.state.points(places(401, 301)).reshape(-1, 3)
    apart, _ = KDTree(fine).query(frame.cloud[::40])
    assert apart.max() < 1e-3
    beside = frame.distance[~frame.sheet]
    assert beside.min() > 1.5


def test_the_hole_has_no_returns():
    frame = render_frames(SheetScene("hole", hole=(45, 22)), [0], np.random.default_rng(1))[0]
    assert np.count_nonzero(frame.hole) == 45 * 22 or np.count_nonzero(frame.hole) == 44 * 22
    assert np.isnan(frame.distance[frame.hole]).all()
    assert not (frame.sheet & frame.hole).any()


def test_gauss_newton_follows_what_bends_and_what_turns():
    for scene in (SheetScene("5 mm", swing), SheetScene("spin", spin)):
        frames = render_frames(scene, range(12), np.random.default_rng(1))
        tracker, at = with_template(lambda vertices: GaussNewton(vertices, 5e-3, *peers.STOP_RULE))(frames[0], 5e-3, 0)
        found = track_frames(tracker, at, frames)
        still = track_frames(*with_template(NoTracking)(frames[0], 5e-3, 0), frames)
        assert found.vertex_mm.mean() < 8 < still.vertex_mm.mean()
        assert np.all(found.surface_mm <= found.vertex_mm)


@pytest.mark.parametrize("stop", [peers.STOP_RULE, peers.SIX_STEPS])
@pytest.mark.parametrize("knows_hole", [False, True])
def test_compiled_gauss_newton_finds_what_the_plain_one_finds(stop: tuple[int, float], knows_hole: bool):
    frames = render_frames(SheetScene("hole", hole=(45, 22)), range(12), np.random.default_rng(1))
    for first, second in pairwise(frames):
        made = [kind(first.state.points(places(SIDE, SIDE).reshape(-1, 2)), 5e-3, *stop, knows_hole) for kind in KINDS]
        compiled, plain = (one.track(second) for one in made)
        np.testing.assert_allclose(compiled, plain, atol=1e-5)


@pytest.mark.slow
def test_ours_follows_what_bends():
    frames = render_frames(SheetScene("5 mm"), range(8), np.random.default_rng(1))
    tracker = OwnTracker(SETUPS[peers.BEST], frames[0], 5e-3, 0)
    found = track_frames(tracker, tracker.places, frames)
    assert found.vertex_mm.max() < 3
    assert found.surface_mm.mean() < 0.9


def test_rivals_that_are_not_installed_are_left_out():
    names = tuple(KNOWN)
    assert set(installed(names)) <= set(names)
    assert not installed(())
