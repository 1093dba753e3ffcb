"""The statistics of the experiment on trust."""

from dataclasses import replace

import numpy as np
import pytest

from evaluation.method.slid_sheets import MAX_DISTANCE_M, SLIDE_FRAME, Slide, creep, sequences
from evaluation.method.trust import Followed, follow
from evaluation.scenes.bent_sheet import (
    CAMERA,
    INTERVAL_S,
    SIZE,
    SheetMotion,
    SheetScene,
    SheetState,
    places,
    render_frames,
    swing,
)
from evaluation.scenes.curtain import Curtain
from evaluation.scenes.rubber import SIGMA, STRAINS, printed_frames, state


def test_a_frame_is_wrong_if_it_claims_tracking_beyond_three_deviations_and_five_millimetres():
    error = np.array([4e-3, 6e-3, 6e-3, 6e-3, 20e-3, 20e-3, 4e-3])
    sigma = np.array([1e-4, 1e-3, 3e-3, 1e-3, 1e-3, 1e-3, 1e-3])
    tracking = np.array([True, True, True, True, True, False, True])
    found = Followed(error, sigma, tracking)
    np.testing.assert_array_equal(found.wrong, [False, True, False, True, True, False, False])
    assert found.longest_wrong == 2


def test_a_slide_moves_the_sheet_along_itself_from_its_frame_on():
    before, after = (SLIDE_FRAME - 1) * INTERVAL_S, SLIDE_FRAME * INTERVAL_S
    slide = Slide(0.04)
    assert slide(before) == swing(before)
    moved = np.subtract(slide(after).center, swing(after).center)
    np.testing.assert_allclose(np.linalg.norm(moved), 0.04, rtol=1e-9)
    np.testing.assert_allclose(np.subtract(creep(INTERVAL_S).center, creep(0).center), [2e-3, 0, 0], atol=1e-12)


def back(t: float) -> SheetState:
    """Swings, and lies 80 mm farther back along itself from the 25th frame on, in which it is bent."""
    state = swing(t)
    first, last = state.points(np.array([[-1e-3, 0.0], [1e-3, 0.0]]))
    x, y, z = state.center - 0.08 * (t > 23.5 * INTERVAL_S) * (last - first) / np.linalg.norm(last - first)
    return replace(state, center=(float(x), float(y), float(z)))


@pytest.mark.parametrize(("motion", "frame"), [(Slide(0.06), SLIDE_FRAME), (back, 24)])
def test_a_sheet_that_jumps_before_nothing_is_not_said_to_be_tracked_while_the_mesh_is_elsewhere(
    motion: SheetMotion, frame: int
):
    """The first is wrong in one frame, in which only the surprise tells; the second for good, as its edges tell."""
    scene = SheetScene("jumps", motion)
    frames = render_frames(scene, range(frame + 8), np.random.default_rng(31))
    empty = [replace(one, distance=np.where(one.distance > MAX_DISTANCE_M, np.nan, one.distance)) for one in frames]
    found = follow(empty, scene.sigma)
    assert found.error_m[frame] > 0.01
    assert not found.wrong.any()
    assert found.tracking[:frame].all()


def test_a_sheet_that_the_end_of_the_view_cuts_is_followed_into_it_and_not_wrong_out_of_it():
    """A corner without return, beside a hexagon, is no background beside which the sheet ends."""
    cut = {name: (scene, measured) for name, scene, measured in sequences(()) if "hexagonal view" in name}
    assert len(cut) == 2
    for name, (scene, measured) in cut.items():
        frames = render_frames(scene, range(24), np.random.default_rng(5))
        found = follow([measured(frame) for frame in frames], scene.sigma)
        assert not found.wrong.any()
        assert found.tracking.mean() > (0.9 if "into" in name else 0.5)


def test_a_sheet_that_is_drawn_under_stripes_without_return_is_not_held_by_them():
    name, scene, measured = next(one for one in sequences(()) if "stripes" in one[0])
    frames = render_frames(scene, range(26), np.random.default_rng(6))
    found = follow([measured(frame) for frame in frames], scene.sigma)
    assert found.error_m[-1] < 0.01, name  # it is drawn by 25 mm
    assert found.tracking.all()


def test_a_round_plate_is_not_tracked_by_distances_alone():
    _, scene, measured = next(one for one in sequences(()) if one[0] == "a round plate turns")
    found = follow([measured(one) for one in render_frames(scene, range(20), np.random.default_rng(5))], scene.sigma)
    assert found.error_m[-1] > 0.03
    assert np.count_nonzero(found.tracking) <= 2  # of the first, in which the plate has hardly turned
    assert not found.wrong.any()


def test_a_curtain_keeps_its_lengths_and_its_material_is_found_again():
    state = Curtain(0.5)(0.3)
    grid = places(61, 41)
    points = state.points(grid)
    steps = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    np.testing.assert_allclose(steps.sum(axis=1), SIZE[0], rtol=2e-3)  # chords of 5 mm
    assert np.ptp(points[..., 2]) > 0.02
    np.testing.assert_allclose(state.material(points[20]), grid[20], atol=1e-3)


def test_a_curtain_is_not_said_to_be_tracked_while_the_mesh_goes_with_its_wrinkles():
    scene = SheetScene("curtain", Curtain(5.0), sigma=2e-3)  # begins elsewhere than those of the experiment
    found = follow(render_frames(scene, range(22), np.random.default_rng(7)), scene.sigma)
    assert found.error_m.max() > 0.008
    assert not found.wrong.any()


def test_rubber_is_at_rest_and_flat_at_first_and_then_stretched_by_some_millimetres():
    grid = places(31, 21)
    for strain in STRAINS.values():
        first, later = state(strain, 0.0), state(strain, 1.0)
        np.testing.assert_allclose(first.material(first.points(grid).reshape(-1, 3)), grid.reshape(-1, 2), atol=1e-12)
        moved = np.linalg.norm(later.points(grid) - later.placed.points(grid), axis=-1)
        assert 3e-3 < moved.max() < 20e-3


def test_a_print_that_the_mesh_of_a_paper_cannot_follow_widens_what_is_claimed():
    shown, pictures = zip(*printed_frames(STRAINS["is sheared"], range(32), np.random.default_rng(8)))
    found = follow(shown, SIGMA, CAMERA, pictures)
    assert found.error_m[-1] > 5e-3
    assert found.tracking[-1]
    assert not found.wrong.any()
    assert found.sigma_m[:5].max() < 1e-3  # as long as it keeps its lengths
