"""The comparison with peers: its scene is what it says, its rival works, and ours are ahead on a short sequence."""

import numpy as np
import pytest

from evaluation.experiment import Context
from evaluation.method import peers
from evaluation.method.peers.gauss_newton import GaussNewton
from evaluation.method.peers.measuring import Followed, follow, least, with_template
from evaluation.method.peers.ours import SETUPS, Ours
from evaluation.method.peers.rivals import KNOWN, Still, installed
from evaluation.scenes.bent_sheet import CAMERA, SIZE, Moment, Scene, film, places, spin, swing


@pytest.mark.parametrize("degrees", [-120, -1, 0, 1e-6, 60, 120])
def test_the_sheet_bends_without_stretching(degrees: float):
    grid = places(61, 41)
    points = Moment(np.deg2rad(degrees), (0.2, -0.3, 0.1), (0.0, 0.1, 1.0)).points(grid)
    along, across = (np.linalg.norm(np.diff(points, axis=axis), axis=-1).sum(axis=axis) for axis in (1, 0))
    np.testing.assert_allclose(along, SIZE[0], rtol=5e-4)  # 60 chords of an arc
    np.testing.assert_allclose(across, SIZE[1], rtol=1e-9)


def test_a_shot_measures_the_sheet_where_it_is():
    shot = film(Scene("quiet", sigma=1e-6), [10], np.random.default_rng(1))[0]
    assert 1400 < np.count_nonzero(shot.sheet) < 2000  # as in the sequences that the goals come from
    columns, rows = np.floor(CAMERA.project(shot.moment.points(places(9, 7) * 0.9)).reshape(-1, 2).T + 0.5).astype(int)
    assert shot.sheet[rows, columns].all()
    fine = shot.moment.points(places(401, 301)).reshape(-1, 3)
    apart = np.linalg.norm(shot.cloud[::40, None] - fine, axis=2).min(axis=1)
    assert apart.max() < 1e-3
    beside = shot.distance[~shot.sheet]
    assert beside.min() > 1.5


def test_the_hole_has_no_returns():
    shot = film(Scene("hole", hole=(45, 22)), [0], np.random.default_rng(1))[0]
    assert np.count_nonzero(shot.hole) == 45 * 22 or np.count_nonzero(shot.hole) == 44 * 22
    assert np.isnan(shot.distance[shot.hole]).all()
    assert not (shot.sheet & shot.hole).any()


def test_gauss_newton_follows_what_bends_and_what_turns():
    for scene in (Scene("5 mm", swing), Scene("spin", spin)):
        shots = film(scene, range(12), np.random.default_rng(1))
        follower, at = with_template(lambda vertices: GaussNewton(vertices, 5e-3))(shots[0], 5e-3, 0)
        found = follow(follower, at, shots)
        still = follow(*with_template(Still)(shots[0], 5e-3, 0), shots)
        assert found.vertex_mm.mean() < 8 < still.vertex_mm.mean()
        assert np.all(found.surface_mm <= found.vertex_mm)


@pytest.mark.slow
def test_ours_follows_what_bends():
    shots = film(Scene("5 mm"), range(8), np.random.default_rng(1))
    tracker = Ours(SETUPS[peers.BEST], shots[0], 5e-3, 0)
    found = follow(tracker, tracker.places, shots)
    assert found.vertex_mm.max() < 3
    assert found.surface_mm.mean() < 0.9


def test_rivals_that_are_not_installed_are_left_out():
    names = tuple(KNOWN)
    assert set(installed(names)) <= set(names)
    assert not installed(())


@pytest.mark.slow
def test_quick_peers():
    findings = peers.run(peers.QUICK, Context(1))
    missed = [goal.name for goal in findings.goals if not goal.met]
    assert not [what for what in missed if "error" in what]
    assert {"5 mm", "15 mm", "hole", "turn", "spin"} == set(findings.values["scenes"])


def test_the_least_time_of_each_frame_counts():
    fast, slow = (Followed(np.zeros((1, 2)), [], [], np.array(ms)) for ms in ([1, 5, 2], [2, 3, 9]))
    np.testing.assert_array_equal(least([fast, slow]).cpu_ms, [1, 3, 2])
