"""A depth image in another view is what that view would measure, and nothing is silently empty."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from calib import pose
from calib.camera import Camera
from calib.warp import errors
from calib.warp.mesh import MAX_STEP_M, MeshWarp
from calib.warp.pictures import PictureLookup
from tests import reference
from tests.calib.warp.scenes import BOARD, SOURCE, VIEWS, WALL, Ball, Plane, image, seen_by

ANY_VIEW = pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
slopes = st.tuples(st.floats(-0.25, 0.25), st.floats(-0.25, 0.25))


@ANY_VIEW
@settings(max_examples=12)
@given(slopes, st.floats(0.7, 1.5))
def test_a_plane_warped_is_the_plane_and_whole(view, slope, offset):
    """Within a face a plane is exact in a pinhole; in a bent image 1/z is off by what the lens bends a pixel."""
    plane = (Plane(np.array([*slope, 1.0]), offset),)
    # Neighbours along the diagonal of a steep plane differ by more than the default step.
    warped = MeshWarp(SOURCE, view, maximum_step_m=0.1).warp(image(SOURCE, plane))
    truth = image(view, plane)
    known = np.isfinite(warped.distance)
    np.testing.assert_allclose(warped.distance[known], truth[known], atol=2e-6 if view.lens.is_pinhole else 3e-4)
    inside, _ = seen_by(SOURCE, view.unproject(truth), plane)
    assert np.mean(known[inside]) > 0.99
    assert not warped.hidden().any()


def test_the_same_view_gives_the_image_back():
    distance = image(SOURCE, (BOARD, WALL)).astype(np.float32)
    warped = MeshWarp(SOURCE, SOURCE).warp(distance)
    np.testing.assert_allclose(warped.distance, distance, atol=1e-6)
    assert np.array_equal(warped.index(), np.arange(distance.size).reshape(distance.shape))
    colors = np.random.default_rng(1).integers(0, 256, (*distance.shape, 3)).astype(np.uint8)
    found = PictureLookup(SOURCE, SOURCE).look(distance).nearest(colors)
    away = ~_near_a_rim(distance)
    np.testing.assert_array_equal(found[away], colors[away])


@ANY_VIEW
def test_there_and_back_again(view):
    distance = image(SOURCE, (WALL,))
    there = MeshWarp(SOURCE, view).warp(distance).distance
    back = MeshWarp(view, SOURCE).warp(there).distance
    known = np.isfinite(back)
    assert np.mean(known) > 0.5
    np.testing.assert_allclose(back[known], distance[known], atol=5e-4)


@ANY_VIEW
def test_what_is_hidden_from_the_source_is_marked_and_what_it_sees_is_right(view):
    planes = (BOARD, WALL)
    warped = MeshWarp(SOURCE, view).warp(image(SOURCE, planes))
    truth = image(view, planes)
    inside, visible = seen_by(SOURCE, view.unproject(truth), planes)
    known, hidden = np.isfinite(warped.distance), warped.hidden()
    # Rims are known to a pixel of the source, which is up to two pixels of the view; away from them all is decided.
    away = ~_near_a_rim(truth) & ~_near_a_rim(np.where(visible, 1.0, 2.0)) & inside
    assert np.count_nonzero(away & ~visible) > 20
    assert np.mean(known[away & visible]) > 0.99
    assert np.mean(hidden[away & ~visible]) > 0.97
    assert not hidden[away & visible].any()
    np.testing.assert_allclose(warped.distance[away & visible & known], truth[away & visible & known], atol=5e-4)


def _near_a_rim(values: np.ndarray) -> np.ndarray:
    """Pixels within two of a jump."""
    padded = np.pad(values, 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))
    return windows.max(axis=(2, 3)) - windows.min(axis=(2, 3)) > 0.15


@ANY_VIEW
def test_pictures_come_from_the_points_that_are_shown_unless_something_hides_them(view):
    """The picture tells where its points are, so every wrong pixel would show."""
    planes = (BOARD, WALL)
    depth = image(SOURCE, planes)
    sight = PictureLookup(SOURCE, view).look(depth)
    picture = view.unproject(image(view, planes))
    points = SOURCE.unproject(depth)
    _, visible = seen_by(view, points, planes)
    away = ~_near_a_rim(depth) & ~_near_a_rim(np.where(visible, 1.0, 2.0))
    assert np.mean(sight.visible[away] == visible[away]) > 0.995
    both = sight.visible & visible & away
    # Half a pixel of the view is up to 10 mm at the wall; between pixels only what perspective bends is left.
    assert np.abs(sight.nearest(picture) - points)[both].max() < 0.02
    assert np.abs(sight.blended(picture) - points)[both].max() < 1e-3
    assert np.isnan(sight.nearest(picture)[~sight.visible]).all()


def test_amplitudes_are_blended_and_labels_are_not():
    view = VIEWS["pinhole"]
    warped = MeshWarp(SOURCE, view).warp(image(SOURCE, (WALL,)))
    points = SOURCE.unproject(image(SOURCE, (WALL,)))
    there = view.unproject(image(view, (WALL,)))
    known = np.isfinite(warped.distance)
    np.testing.assert_allclose(warped.blended(points[..., 0])[known], there[known, 0], atol=2e-5)
    labels = np.arange(points[..., 0].size, dtype=np.int32).reshape(SOURCE.height, SOURCE.width)
    chosen = warped.nearest(labels, missing=-1)
    assert np.array_equal(chosen >= 0, known)
    place = SOURCE.project(there)
    column, row = chosen % SOURCE.width, chosen // SOURCE.width
    assert np.abs(np.stack([column, row], axis=-1) - place)[known].max() < 1.0


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_the_kernels_are_their_definition(seed):
    """Against all faces of a random surface with gaps, one at a time, in NumPy."""
    generator = np.random.default_rng(seed)
    source = Camera(7, 6, 9.0, 9.0, 3.0, 2.5)
    view = Camera(16, 13, 20.0, 20.0, 7.6, 6.2, T_rs=pose.from_rotation_vector([0.1, 0, 0.2], [0.05, 0, -0.02]))
    distance = generator.choice([0.9, 1.4], (6, 7)) + generator.uniform(0, 0.02, (6, 7))
    distance[generator.random((6, 7)) < 0.15] = np.nan
    try:
        warped = MeshWarp(source, view).warp(distance)
    except errors.NoSurfaceError:
        reject()  # no three neighbours are of one surface
    sigma = generator.uniform(1e-3, 5e-3, (6, 7))
    deviation = warped.deviation(sigma)
    expected, spread, margin = reference.warped(source, view, distance, sigma, MAX_STEP_M)
    decided = margin > 1e-3
    assert np.array_equal(np.isfinite(warped.distance)[decided], np.isfinite(expected)[decided])
    np.testing.assert_allclose(warped.distance[decided], expected[decided], rtol=1e-5)
    np.testing.assert_allclose(deviation[decided], spread[decided], rtol=2e-3)


def test_nothing_behind_a_rim_is_mistaken_for_the_rim():
    """A board ends between two pixels of the source; what the view shows of the wall there may be the board."""
    for view in VIEWS.values():
        for solids in ((BOARD, WALL), (Ball(np.array([0.0, 0.02, 0.9]), 0.15), WALL)):
            off = MeshWarp(SOURCE, view).warp(image(SOURCE, solids)).distance - image(view, solids)
            assert np.mean(np.abs(off[np.isfinite(off)]) > 0.1) < 2e-3


def test_bands_of_rows_may_be_worked_on_in_any_order():
    view, distance = VIEWS["fisheye"], image(SOURCE, (BOARD, WALL))
    whole = MeshWarp(SOURCE, view).warp(distance)
    parts = MeshWarp(SOURCE, view, each=lambda work, bands: [work(band) for band in reversed(list(bands))], parts=5)
    np.testing.assert_array_equal(parts.warp(distance).distance, whole.distance)


@pytest.mark.parametrize("amplitude", [0.0, 0.01])
def test_the_deviation_is_that_of_many_warps(amplitude):
    """Monte Carlo over noise and over where the pixels meet a waved wall: mean square of error over deviation is 1."""
    view = VIEWS["pinhole"]
    generator, sigma = np.random.default_rng(7), 2e-3
    squares = []
    for _ in range(40):
        phase = generator.uniform(0, 2 * np.pi, 2)
        clean, truth = (_waved(camera, amplitude, phase) for camera in (SOURCE, view))
        warped = MeshWarp(SOURCE, view).warp(clean + generator.normal(0, sigma, clean.shape))
        score = (warped.distance - truth) / warped.deviation(np.full(clean.shape, sigma))
        squares.append(score[np.isfinite(score)] ** 2)
    assert np.mean(np.concatenate(squares)) == pytest.approx(1.0, abs=0.12)


def _waved(camera: Camera, amplitude: float, phase: np.ndarray) -> np.ndarray:
    """Radial distances to z = 1.2 + 0.2 x + A (sin(25 x + φ) + sin(25 y + φ')), by iteration along the rays."""
    rays = camera.rays() @ camera.T_rs[:3, :3].T
    far = np.full(rays.shape[:2], 1.2)
    for _ in range(60):
        x, y, _ = np.moveaxis(camera.center + rays * far[..., None], -1, 0)
        surface = 1.2 + 0.2 * x + amplitude * (np.sin(25 * x + phase[0]) + np.sin(25 * y + phase[1]))
        far = (surface - camera.center[2]) / rays[..., 2]
    return far


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda d: d[1:], errors.WarpError, "64 × 55 pixels is not one of the camera's 64 × 56"),
        (lambda d: np.full_like(d, np.nan), errors.NoReturnsError, "none of the 64 × 56 pixels has a distance"),
        (lambda d: d * 1000, errors.UnitError, r"median distance of 1\d+.* millimetres"),
    ],
)
def test_images_that_cannot_be_meant_are_refused(change, error, message):
    with pytest.raises(error, match=message):
        MeshWarp(SOURCE, VIEWS["pinhole"]).warp(change(image(SOURCE, (WALL,))))


def test_cameras_that_do_not_look_at_the_same_are_named():
    distance = image(SOURCE, (WALL,))
    away = dataclasses.replace(SOURCE, T_rs=pose.from_rotation_vector([0, np.pi, 0], [0, 0, 0]))
    with pytest.raises(
        errors.NoOverlapError, match="none is in the view of the target of 64 × 56 pixels: 0 lie before"
    ):
        MeshWarp(SOURCE, away).warp(distance)
    aside = dataclasses.replace(VIEWS["pinhole"], T_rs=pose.from_rotation_vector([0, 0, 0], [5.0, 0, 0]))
    with pytest.raises(errors.NoOverlapError, match="3584 lie before its camera but beside its image"):
        MeshWarp(SOURCE, aside).warp(distance)
    in_mm = dataclasses.replace(SOURCE, T_rs=pose.from_rotation_vector([0, 0, 0], [-32.0, -2.0, 4.0]))
    with pytest.raises(errors.UnitError, match=r"32\.\d+ m apart, .* is T_rs in millimetres"):
        MeshWarp(SOURCE, in_mm).warp(distance)


def test_an_image_without_three_neighbours_of_one_surface_is_named():
    rows, columns = np.indices((SOURCE.height, SOURCE.width))
    noise = 1.0 + 0.1 * ((rows + 2 * columns) % 5)  # any two neighbours are 0.1 m apart, or more
    with pytest.raises(errors.NoSurfaceError, match="3584 are in the view, but none of them with two neighbours"):
        MeshWarp(SOURCE, SOURCE).warp(noise)
