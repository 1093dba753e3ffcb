"""The regions seed, above_plane and distance, and the limit `within`: objects that lie on a table."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.tracker.detection.depth_view import DepthView, limited
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import above_plane, box, distance, mask, nearest, seed
from calib import pose
from calib.camera import Camera

CAMERA = Camera(160, 120, 140.0, 140.0, 79.5, 59.5, T_rs=pose.from_rotation_vector([0.3, 0.1, 0.0], [0.2, -0.1, 0.4]))
#: Height of the camera above the table [m], and unit vector that points up from it, in the sensor's frame.
HEIGHT, UP = 0.8, np.array([0.0, -np.cos(1.0), -np.sin(1.0)])
NOISE_M = 0.001


def table(*heights: tuple[slice, slice, float]) -> DepthView:
    """A table that fills the image, with flat things on it: rows, columns and height above the table [m]."""
    above = np.zeros((120, 160))
    for rows, columns, height in heights:
        above[rows, columns] = height
    lengths = (HEIGHT - above) / -(CAMERA.rays() @ UP)
    lengths += np.random.default_rng(3).normal(0, NOISE_M, lengths.shape)
    return DepthView.of(np.where((lengths > 0) & (lengths < 4), lengths, np.nan).astype(np.float32), CAMERA)


LARGE = (slice(50, 90), slice(20, 70), 0.06)
SMALL = (slice(60, 85), slice(100, 130), 0.05)


def assert_is(selected: np.ndarray, thing: tuple[slice, slice, float]) -> None:
    """Asserts that pixels of the thing alone are selected, and all but its rim."""
    inside = np.zeros(selected.shape, bool)
    inside[thing[:2]] = True
    assert not (selected & ~inside).any()
    assert selected[thing[:2]][4:-4, 4:-4].all()


def test_nearest_refuses_a_table_with_things_on_it():
    with pytest.raises(DetectionError, match=r'is the scene.*"above_plane"'):
        nearest.Settings(maximum_step_m=0.1).build().select(table(LARGE, SMALL))


def test_the_largest_thing_on_a_table_is_selected():
    assert_is(above_plane.Settings().build().select(table(LARGE, SMALL)), LARGE)


@pytest.mark.parametrize("pixel", [(115, 72), (97, 72)])  # on it, and a little beside it
def test_a_seed_selects_another_thing_on_a_table(pixel):
    assert_is(above_plane.Settings(seed=pixel).build().select(table(LARGE, SMALL)), SMALL)


def test_the_plane_is_the_same_every_time():
    view = table(LARGE, SMALL)
    region = above_plane.Settings().build()
    np.testing.assert_array_equal(region.select(view), region.select(view))


def test_what_is_behind_the_plane_is_not_above_it():
    view = table(LARGE, (slice(60, 120), slice(90, 160), -0.3))  # a hole in the table, and the floor
    assert_is(above_plane.Settings().build().select(view), LARGE)


def test_the_plane_is_found_outside_of_the_mask_too(tmp_path):
    path, within = drawn(tmp_path, SMALL[:2])
    selected = above_plane.Settings(within=path).build().select(table(LARGE, SMALL))
    assert_is(selected, SMALL)
    assert not (selected & ~within).any()


def test_an_empty_table_has_nothing_above_it():
    with pytest.raises(DetectionError, match=r"more than clearance_m = 0\.01 m above the plane: no connected surface"):
        above_plane.Settings().build().select(table())


def test_a_seed_far_from_everything_says_what_is_nearest():
    with pytest.raises(DetectionError, match=r"within 10 pixels of \[10, 10\]; the nearest one is \d+ pixels away, at"):
        above_plane.Settings(seed=(10, 10)).build().select(table(LARGE))


def test_a_scene_without_a_plane_says_so():
    generator = np.random.default_rng(5)
    view = DepthView.of(generator.uniform(0.5, 3.0, (120, 160)).astype(np.float32), CAMERA)
    with pytest.raises(DetectionError, match=r"no plane: .* clearance_m = 0\.01 m"):
        above_plane.Settings().build().select(view)
    with pytest.raises(DetectionError, match="no plane"):
        above_plane.Settings().build().select(limited(view, np.zeros((120, 160), bool)))


def test_a_plane_of_a_seventh_of_the_returns_is_not_what_an_object_lies_on():
    lengths = np.random.default_rng(5).uniform(0.5, 3.0, (120, 160)).astype(np.float32)
    lengths[:, :23] = table().distance[:, :23]
    with pytest.raises(DetectionError, match=r"no plane: the largest has 1\d% of the returns .* 20% needed"):
        above_plane.Settings().build().select(DepthView.of(lengths, CAMERA))


def before_a_wall(*parts: tuple[slice, slice, float]) -> DepthView:
    lengths = np.full((120, 160), 2.0, np.float32)
    for rows, columns, length in parts:
        lengths[rows, columns] = length
    return DepthView.of(lengths, CAMERA)


NEAR = (slice(20, 50), slice(20, 60), 1.0)
FAR = (slice(20, 70), slice(90, 140), 1.5)


@pytest.mark.parametrize(("pixel", "thing"), [((30, 30), NEAR), ((100, 40), FAR), ((62, 30), NEAR), ((90, 20), FAR)])
def test_a_seed_selects_the_surface_at_its_pixel_or_beside_it(pixel, thing):
    view = before_a_wall(NEAR, FAR)
    view.distance[:, 61:90] = np.nan
    assert_is(seed.Settings(pixel).build().select(view), thing)


def test_a_seed_in_a_hole_of_the_image_selects_the_surface_around_it():
    view = before_a_wall(NEAR)
    view.distance[33:37, 38:42] = np.nan
    assert seed.Settings((40, 35)).build().select(view)[25, 30]


def test_a_seed_outside_of_the_image_is_told_its_size():
    with pytest.raises(DetectionError, match=r"\[160, 10\] is outside the depth image of 160 × 120 pixels"):
        seed.Settings((160, 10)).build().select(before_a_wall(NEAR))


def test_a_seed_without_returns_around_it_is_refused():
    view = before_a_wall(NEAR)
    view.distance[60:, :] = np.nan
    with pytest.raises(DetectionError, match=r"within 10 pixels of \[80, 100\]"):
        seed.Settings((80, 100)).build().select(view)


def test_the_largest_surface_in_a_range_of_distances_is_selected():
    speck = (slice(100, 116), slice(4, 20), 1.2)
    view = before_a_wall(NEAR, FAR, speck)
    assert_is(distance.Settings(maximum_m=1.3).build().select(view), NEAR)
    assert_is(distance.Settings(maximum_m=1.8, minimum_m=1.1).build().select(view), FAR)
    assert_is(distance.Settings(maximum_m=1.3, minimum_m=1.1, minimum_pixels=16).build().select(view), speck)


def test_an_empty_range_of_distances_is_named():
    with pytest.raises(DetectionError, match=r"from 0\.2 to 0\.9 m: no connected surface of .* minimum_pixels = 200"):
        distance.Settings(maximum_m=0.9, minimum_m=0.2).build().select(before_a_wall(NEAR))


def test_a_range_of_distances_inside_out_is_refused():
    with pytest.raises(DetectionError, match=r"minimum_m = 1\.0 must be below maximum_m = 0\.5"):
        distance.Settings(maximum_m=0.5, minimum_m=1.0)


def drawn(folder: Path, where: tuple[slice, slice]) -> tuple[Path, np.ndarray]:
    """A mask image, and its pixels."""
    within = np.zeros((120, 160), bool)
    within[where] = True
    path = folder / "within.png"
    cv2.imwrite(str(path), within * np.uint8(255))
    return path, within


REGIONS = {
    "nearest": nearest.Settings,
    "seed": lambda within=None: seed.Settings((45, 60), within=within),
    "above_plane": above_plane.Settings,
    "distance": lambda within=None: distance.Settings(3.0, within=within),
    "box": lambda within=None: box.Settings((-2, -2, 0), (2, 2, 3), (0.1, 0.2, 0.3), within),
}


@pytest.mark.parametrize("name", REGIONS)
def test_a_missing_limit_is_named_when_the_region_is_built(name, tmp_path):
    with pytest.raises(DetectionError, match=r"within = .*no\.png': cannot be read"):
        REGIONS[name](within=tmp_path / "no.png").build()


@pytest.mark.parametrize("name", REGIONS)
def test_a_limit_of_another_size_is_refused(name, tmp_path):
    cv2.imwrite(str(tmp_path / "small.png"), np.full((60, 80), 255, np.uint8))
    with pytest.raises(DetectionError, match=r"mask is \(80, 60\) pixels, the depth image \(160, 120\)"):
        REGIONS[name](within=tmp_path / "small.png").build().select(table(LARGE))


LADEN = table(LARGE, SMALL).distance


@pytest.mark.parametrize("name", REGIONS)
@settings(max_examples=40)  # each is two selections, of 20 ms where a plane is searched
@given(
    top=st.integers(0, 60), left=st.integers(0, 80), height=st.integers(20, 60), width=st.integers(20, 80),
    hidden=st.floats(0, 0.3), generator=st.integers(0, 2**32 - 1),
)  # fmt: skip
def test_only_measured_pixels_within_the_limit_are_selected(
    tmp_path_factory, name, top, left, height, width, hidden, generator
):
    lost = np.random.default_rng(generator).uniform(size=(120, 160)) < hidden
    view = DepthView.of(np.where(lost, np.float32(np.nan), LADEN), CAMERA)
    path, within = drawn(tmp_path_factory.getbasetemp(), (slice(top, top + height), slice(left, left + width)))
    for region, allowed in ((REGIONS[name](), True), (REGIONS[name](within=path), within)):
        try:
            selected = region.build().select(view)
        except DetectionError:
            continue  # an image without the object
        assert selected.any()
        assert not (selected & ~(view.measured & allowed)).any()


@pytest.fixture(scope="module")
def toy(data_set: Callable[[str], Path]) -> tuple[DepthView, Path]:
    """First frame of a real recording, a sponge under a hand and a toy on a white table, and the sponge's mask."""
    folder = data_set("sl_rgbd_deform_petit")
    camera = Camera(320, 240, 275.0, 275.0, 160.0, 120.0)
    z_mm = np.asarray(cv2.imread(str(folder / "depth_mm_000200.png"), cv2.IMREAD_UNCHANGED))
    lengths = np.where(z_mm > 0, z_mm * 1e-3 * camera.lookup.ray_length, np.nan).astype(np.float32)
    return DepthView.of(lengths, camera), folder / "sponge_000200.png"


def test_nearest_refuses_a_real_table(toy):
    with pytest.raises(DetectionError, match=r"has 74% of all returns and spans the image"):
        nearest.Settings().build().select(toy[0])


def test_a_real_sponge_is_found_on_its_table(toy):
    view, path = toy
    sponge = mask.Settings(path).build().select(view)
    with pytest.raises(DetectionError, match=r"has 16% of all returns and lies along the image's border"):
        above_plane.Settings().build().select(view)  # hand, arm and body are connected to it
    held = above_plane.Settings(seed=(111, 133)).build().select(view)  # with the hand, without arm and body
    assert np.count_nonzero(held & sponge) > 0.85 * np.count_nonzero(sponge)
    assert np.count_nonzero(held) < 2 * np.count_nonzero(sponge)
    alone = above_plane.Settings(seed=(111, 133), maximum_step_m=0.015).build().select(view)
    assert np.count_nonzero(alone & sponge) > 0.75 * np.count_nonzero(sponge)
    assert np.count_nonzero(alone & ~sponge) < 0.02 * np.count_nonzero(alone)


def test_a_real_sponge_is_found_within_its_mask(toy):
    view, path = toy
    sponge = mask.Settings(path).build().select(view)
    for region in (nearest.Settings(within=path), above_plane.Settings(within=path)):
        selected = region.build().select(view)
        assert not (selected & ~sponge).any()
        assert np.count_nonzero(selected) > 0.8 * np.count_nonzero(sponge)
