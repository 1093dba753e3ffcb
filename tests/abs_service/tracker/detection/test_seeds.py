"""The region seed: by pixel and by colour; where depth cannot separate an object, its colours can."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from abs_service.tracker.detection.depth_view import DepthView
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.regions import mask, seed
from abs_service.tracker.detection.segments.color_growth import grown_by_color
from abs_service.tracker.detection.segments.seeds import Seeded
from calib import pose
from calib.camera import Camera

DEPTH = Camera(160, 120, 140.0, 140.0, 79.5, 59.5)
#: A colour camera of another size, 6 cm beside the depth camera and turned towards what it sees.
COLOR = Camera(200, 150, 170.0, 170.0, 99.5, 74.5, T_rs=pose.from_rotation_vector([0.0, -0.05, 0.0], [0.06, 0.0, 0.0]))
TABLE_M, NOISE_M, COLOR_NOISE = 1.0, 0.002, 6.0

#: Rectangles on the table: left, right, top, bottom [m], and colour.
RED = (-0.25, -0.02, -0.15, 0.12), (170, 60, 60)
BLUE = (0.1, 0.35, -0.1, 0.1), (60, 80, 160)
WOOD = (150, 130, 105)

Sheet = tuple[tuple[float, float, float, float], tuple[int, int, int]]


def on_the_table(camera: Camera) -> np.ndarray:
    """Coordinates (height, width, 2) [m] on the table z = TABLE_M of a camera's pixels."""
    rays = camera.rays() @ camera.T_rs[:3, :3].T
    return (camera.center + rays * ((TABLE_M - camera.center[2]) / rays[..., 2])[..., None])[..., :2]


def covers(sheet: Sheet, camera: Camera) -> np.ndarray:
    """Pixels (height, width) of a camera that show a sheet."""
    left, right, top, bottom = sheet[0]
    x, y = np.moveaxis(on_the_table(camera), -1, 0)
    return (x > left) & (x < right) & (y > top) & (y < bottom)


def contact(*sheets: Sheet, ink: bool = False) -> DepthView:
    """Sheets of paper that lie flat on a table: their distance is the table's."""
    generator = np.random.default_rng(7)
    distance = TABLE_M * DEPTH.lookup.ray_length + generator.normal(0, NOISE_M, (120, 160))
    picture = np.full((150, 200, 3), WOOD, float)
    for sheet in sheets:
        picture[covers(sheet, COLOR)] = sheet[1]
    if ink:
        x, y = np.moveaxis(on_the_table(COLOR), -1, 0)
        picture[(np.hypot(x + 0.13, y) < 0.04) & (np.hypot(x + 0.13, y) > 0.02)] = (30, 30, 30)
    picture += generator.normal(0, COLOR_NOISE, picture.shape)
    rgb = np.clip(picture, 0, 255).astype(np.uint8)
    return DepthView.of(distance.astype(np.float32), DEPTH, [(COLOR, rgb)])


def overlap(selected: np.ndarray, truth: np.ndarray) -> float:
    """Intersection over union."""
    return float(np.count_nonzero(selected & truth) / np.count_nonzero(selected | truth))


def at(sheet: Sheet) -> tuple[int, int]:
    """Column and row of the middle of a sheet."""
    row, column = np.argwhere(covers(sheet, DEPTH)).mean(axis=0).astype(int).tolist()
    return column, row


@pytest.mark.parametrize("sheet", [RED, BLUE])
def test_colours_separate_a_sheet_on_a_table_that_depth_does_not(sheet):
    view, truth = contact(RED, BLUE), covers(sheet, DEPTH)
    assert overlap(seed.Settings(at(sheet)).build().select(view), truth) < 0.25
    assert overlap(seed.Settings(at(sheet), grow="color").build().select(view), truth) > 0.9
    by_color = seed.Settings(color=sheet[1], grow="color").build().select(view)
    assert overlap(by_color, truth) > 0.9


def test_a_print_is_part_of_what_it_is_on():
    view = contact(RED, BLUE, ink=True)
    selected = seed.Settings((at(RED)[0] - 8, at(RED)[1] + 10), grow="color").build().select(view)
    assert overlap(selected, covers(RED, DEPTH)) > 0.9


def standing(thing: np.ndarray, height: np.ndarray, colors: np.ndarray) -> DepthView:
    """A view of the table with a thing on it, a colour camera in the depth camera's place.

    Args:
        thing: its pixels (height, width).
        height: of the surface above the table (height, width) [m].
        colors: of the thing (height, width, 3).
    """
    generator = np.random.default_rng(5)
    distance = (TABLE_M - height) * DEPTH.lookup.ray_length + generator.normal(0, NOISE_M, height.shape)
    picture = np.where(thing[..., None], colors, WOOD) + generator.normal(0, COLOR_NOISE, (*height.shape, 3))
    return DepthView.of(distance.astype(np.float32), DEPTH, [(DEPTH, np.clip(picture, 0, 255).astype(np.uint8))])


def test_a_thing_on_a_table_is_found_in_light_and_shade():
    thing = np.zeros((120, 160), bool)
    thing[30:90, 20:120] = True
    light = np.linspace(0.4, 1, 100)[None, :, None] * np.ones((120, 1, 3))
    colors = np.zeros((120, 160, 3))
    colors[:, 20:120] = light * (200, 120, 60)
    view = standing(thing, np.where(thing, 0.03, 0.0), colors)
    for column in (30, 70, 110):
        assert overlap(seed.Settings((column, 60), grow="color").build().select(view), thing) > 0.8


def test_a_sheet_is_whole_that_is_the_dominant_plane_and_bends_out_of_it():
    sheet = np.ones((120, 160), bool)
    height = 0.1 * np.clip((np.arange(160) - 100) / 60, 0, None)[None] ** 2 * np.ones((120, 1))
    view = standing(sheet, height, np.full((120, 160, 3), (170.0, 60.0, 60.0)))
    assert overlap(seed.Settings((150, 60), grow="color").build().select(view), sheet) > 0.9


@given(
    hidden=st.floats(0, 0.9), unseen=st.floats(0, 0.9), rows=st.integers(1, 120), columns=st.integers(1, 160),
    levels=st.integers(1, 255), generator=st.integers(0, 2**32 - 1), bend=st.floats(0, 0.1),
)  # fmt: skip
def test_whatever_the_colours_the_object_is_on_the_surface_and_has_the_seed(
    hidden, unseen, rows, columns, levels, generator, bend
):
    drawn = np.random.default_rng(generator)
    surface = drawn.uniform(size=(120, 160)) >= hidden
    surface[rows:] = surface[:, columns:] = False
    assume(surface.any())
    core = surface & (drawn.uniform(size=surface.shape) < 0.05)
    rgb = drawn.integers(0, levels, (120, 160, 3)).astype(np.float32)
    rgb[drawn.uniform(size=surface.shape) < unseen] = np.nan
    assume((core & np.isfinite(rgb[..., 0])).any())
    lengths = DEPTH.lookup.ray_length - bend * drawn.uniform(size=surface.shape)
    colors = SimpleNamespace(rgb=rgb)
    view = replace(DepthView.of(np.where(surface, lengths, np.nan).astype(np.float32), DEPTH), colors=colors)
    selected = grown_by_color(Seeded(core, surface), view)
    assert (selected & core).any()
    assert not (selected & ~surface).any()


def test_the_same_image_has_the_same_region():
    view = contact(RED, BLUE)
    region = seed.Settings(at(RED), grow="color").build()
    np.testing.assert_array_equal(region.select(view), region.select(view))


def test_colours_and_a_limit_go_together(tmp_path):
    left = np.zeros((120, 160), np.uint8)
    left[:, : at(RED)[0] + 2] = 255
    cv2.imwrite(str(tmp_path / "left.png"), left)
    selected = seed.Settings(at(RED), grow="color", within=tmp_path / "left.png").build().select(contact(RED))
    assert overlap(selected, covers(RED, DEPTH) & (left > 0)) > 0.8  # every surface loses a pixel or two at a limit
    assert not (selected & (left == 0)).any()


def test_something_between_colour_camera_and_table_takes_no_colour_to_it():
    """A red plate before the table: the colour camera sees it where the depth camera sees the table behind it."""
    view = contact()
    rgb = np.full((150, 200, 3), WOOD, np.uint8)
    near = np.zeros((120, 160), bool)
    near[40:80, 60:100] = True
    distance = np.where(near, 0.6 * DEPTH.lookup.ray_length, view.distance).astype(np.float32)
    columns, rows = np.floor(COLOR.project(DepthView.of(distance, DEPTH).points_r[near]) + 0.5).astype(int).T
    rgb[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1] = RED[1]
    view = DepthView.of(distance, DEPTH, [(COLOR, rgb)])
    red = np.abs(view.colors.rgb - RED[1]).max(axis=-1) < 5
    assert overlap(red, near) > 0.9
    assert overlap(seed.Settings(color=RED[1]).build().select(view), near) > 0.7


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            seed.Settings((80, 60), grow="color"),
            r'no colour camera \(noise type "color"\) sees the seed: grow = "depth"',
        ),
        (seed.Settings(color=(170, 60, 60)), r'color needs a colour camera \(noise type "color"\)'),
    ],
)
def test_without_a_colour_camera_colours_are_refused_in_words(settings, message):
    away = replace(COLOR, T_rs=pose.from_rotation_vector([0.0, 3.0, 0.0], [0.0, 0.0, 0.0]))  # it looks back
    for pictures in ([], [(away, np.full((150, 200, 3), 99, np.uint8))]):
        with pytest.raises(DetectionError, match=message):
            settings.build().select(DepthView.of(contact().distance, DEPTH, pictures))


def test_a_colour_that_is_not_in_sight_is_named():
    with pytest.raises(
        DetectionError, match=r"no surface of about the color \[0, 200, 0\]: the largest has \d+ pixels"
    ):
        seed.Settings(color=(0, 200, 0)).build().select(contact(RED))


@pytest.mark.parametrize(("keys", "found"), [({}, "none"), ({"pixel": (1, 1), "motion_s": 1.0}, "pixel and motion_s")])
def test_one_seed_is_wanted(keys, found):
    with pytest.raises(DetectionError, match=f"one of pixel, color and motion_s .* not {found}"):
        seed.Settings(**keys)


@pytest.mark.parametrize("number", [200, 229, 258, 287, 316])
def test_a_real_sponge_on_a_table_is_separated_by_its_colours(data_set: Callable[[str], Path], number):
    folder = data_set("sl_rgbd_deform_petit")
    camera = Camera(320, 240, 275.0, 275.0, 160.0, 120.0)
    z_mm = np.asarray(cv2.imread(str(folder / f"depth_mm_{number:06d}.png"), cv2.IMREAD_UNCHANGED))
    lengths = np.where(z_mm > 0, z_mm * 1e-3 * camera.lookup.ray_length, np.nan).astype(np.float32)
    rgb = np.asarray(cv2.imread(str(folder / f"color_{number:06d}.png"), cv2.IMREAD_COLOR_RGB), np.uint8)
    view = DepthView.of(lengths, camera, [(camera, rgb)])
    sponge = mask.Settings(folder / f"sponge_{number:06d}.png").build().select(view)
    assert overlap(seed.Settings((111, 133)).build().select(view), sponge) < 0.1
    assert overlap(seed.Settings((111, 133), grow="color").build().select(view), sponge) > 0.75
    assert overlap(seed.Settings(color=(146, 50, 72), grow="color").build().select(view), sponge) > 0.8
