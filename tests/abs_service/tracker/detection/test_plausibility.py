"""Doubts about a detected object: a region that selects the scene is told, an object is not."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.tracker.detection.grid_mesh import grid_mesh
from abs_service.tracker.detection.plausibility import (
    camera_warnings,
    left_out_warnings,
    mesh_warnings,
    noise_warnings,
    warnings,
)
from abs_service.tracker.detection.regions import box, nearest, seed
from calib import pose
from calib.camera import Camera
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.detection.test_segmentation import EVERYWHERE, SHEET, detect


@pytest.mark.parametrize("region", [EVERYWHERE, seed.Settings((50, 40), maximum_step_m=5.0).build()])
def test_a_region_that_selects_the_scene_is_told(region):
    (doubt,) = warnings(detect(SHEET, region))
    assert doubt.startswith("the object fills ")
    assert "% of all returns, from side to side: is the region right?" in doubt


@pytest.mark.parametrize("region", [nearest.Settings(), box.Settings((-0.1, -0.1, 0.5), (0.1, 0.1, 1.5))])
def test_an_object_in_the_scene_raises_no_doubts(region):
    assert warnings(detect(SHEET, region.build())) == ()


def test_a_large_object_that_ends_in_the_image_raises_no_doubts():
    distance = np.full((48, 64), 2.0, np.float32)
    distance[5:43, 6:58] = 1.0  # 64 % of the image
    assert warnings(detect(distance, nearest.Settings().build())) == ()


def test_an_object_along_the_border_of_the_image_is_told():
    distance = np.full((48, 64), 2.0, np.float32)
    distance[:, 50:] = 1.0  # a side wall
    (doubt,) = warnings(detect(distance, nearest.Settings().build()))
    assert doubt.startswith("the object lies along 5")
    assert "pixels of the image's border, like a wall or a floor: is the region right?" in doubt


def test_distances_that_scatter_more_than_their_noise_model_says_are_told():
    detection = detect(SHEET, nearest.Settings().build())
    assert noise_warnings(detection) == ()
    (doubt,) = noise_warnings(replace(detection, deviation=12e-3, noise_scale=2.4))
    assert doubt.startswith(
        "distances scatter by 12.0 mm about flat things as far away as the object, and not by 5.0 mm, as the sensor's "
        "noise model says: all its deviations are taken 2.4 times as large"
    )


@pytest.mark.parametrize(("fitting", "words"), [(0.1, "ten times the true ones"), (10.0, "a tenth of the true ones")])
def test_a_unit_that_the_scatter_contradicts_is_told_instead_of_noise(fitting, words):
    detection = replace(detect(SHEET, nearest.Settings().build()), noise_scale=11.0, fitting_scale=fitting)
    (doubt,) = noise_warnings(detection)
    assert doubt.startswith(f"distances scatter as if they were {words}")
    assert "is the depth scale right?" in doubt


def test_a_mesh_of_two_pieces_is_told_unless_a_file_has_it_so():
    distance = np.full((48, 64), 2.0, np.float32)
    distance[5:43, 6:58] = 1.0
    whole = grid_mesh(detect(distance, EVERYWHERE))
    distance[:, 40:48] = np.nan
    distance[distance > 1.5] = np.nan
    parted = grid_mesh(detect(distance, EVERYWHERE))
    assert mesh_warnings(whole) == ()
    (doubt,) = mesh_warnings(parted)
    assert doubt.startswith("the mesh has 2 pieces, of 78% and 22% of its vertices: ")
    assert mesh_warnings(replace(parted, is_complete=True)) == ()


def test_parts_that_are_too_narrow_for_the_mesh_are_told():
    distance = np.full((48, 64), np.nan, np.float32)
    distance[8:40, 4:28] = 1.0
    palm = replace(detect(distance), vertices=60)
    for row in (9, 18, 27, 36):  # four fingers
        distance[row : row + 3, 28:60] = 1.0
    hand = replace(detect(distance), vertices=60)
    assert left_out_warnings(palm, grid_mesh(palm)) == ()
    (doubt,) = left_out_warnings(hand, grid_mesh(hand))
    assert doubt.startswith("28% of what was found lie beside the mesh, whose vertices are ")
    assert left_out_warnings(hand, replace(grid_mesh(hand), is_complete=True)) == ()


@pytest.mark.parametrize(
    ("cx", "cy", "is_doubtful"), [(330.0, 230.0, False), (160.0, 120.0, True), (640.0, 360.0, True)]
)
def test_a_principal_point_of_another_image_size_is_doubted(cx, cy, is_doubtful):
    """Intrinsics of half the size, and of 1280 × 720."""
    rig = Rig("r", {"tof": Sensor("tof", Camera(640, 480, 585.0, 585.0, cx, cy), StructuredLight())})
    found = camera_warnings(rig)
    assert bool(found) == is_doubtful
    if is_doubtful:
        assert found[0].startswith(
            f"the principal point of tof, ({cx:.0f}, {cy:.0f}) px, is far from the middle of its"
        )


@pytest.mark.parametrize(("width", "height"), [(640, 480), (320, 240), (848, 480)])
def test_an_exchanged_principal_point_is_doubted(width, height):
    camera = Camera(width, height, 585.0, 585.0, height / 2 + 4, width / 2 - 7)
    rig = Rig("r", {"tof": Sensor("tof", camera, StructuredLight())})
    (doubt,) = camera_warnings(rig)
    assert doubt.endswith(
        f"in the middle of images of {height} × {width} pixels, not of {width} × {height}: are cx and cy exchanged?"
    )


def test_a_pose_in_millimetres_is_doubted():
    camera = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)

    def doubts_of(right_m):
        color = replace(camera, T_rs=pose.from_rotation_vector((0, 0, 0), (right_m, 0, 0)))
        sensors = {name: Sensor(name, one, StructuredLight()) for name, one in (("tof", camera), ("color", color))}
        return camera_warnings(Rig("r", sensors))

    assert doubts_of(0.025) == ()
    assert doubts_of(25.0) == ("tof and color are 25.0 m apart: are their poses in metres?",)
