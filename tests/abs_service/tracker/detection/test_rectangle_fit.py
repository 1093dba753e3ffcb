"""A flat sheet is detected with accurate pose and size and stable axes; other objects are rejected."""

import dataclasses

import numpy as np
import pytest

from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection
from abs_service.tracker.detection.shapes.rectangle_fit import LIMITS, find_sheet
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.models.flexpad import Settings
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens

CAMERA = Camera(
    320,
    240,
    300.0,
    300.0,
    159.5,
    119.5,
    Lens(np.array([-0.1, 0.02])),
    pose.from_rotation_vector([0.1, -0.2, 0.05], [0.1, 0.2, -0.3]),
)
RAYS = CAMERA.rays()
A4 = (0.297, 0.210)
#: Footprint of a pixel on a sheet at 0.9 m: 3 mm.
PIXEL = 0.9 / 300


def placed(turn: float = 0.0, tilt: float = 0.0) -> np.ndarray:
    """Pose of a plane in front of the camera, rotated about its normal and tilted [rad]; its z axis points away."""
    T_sp = pose.from_rotation_vector([tilt, -tilt / 2, 0], [0.02, -0.01, 0.9])
    return CAMERA.T_rs @ T_sp @ pose.from_rotation_vector([0, 0, turn], [0, 0, 0])


def on_plane(T_rp: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances of a plane in every pixel, and both coordinates on it [m]."""
    T_ps = pose.inverse(T_rp) @ CAMERA.T_rs
    rays = RAYS @ T_ps[:3, :3].T
    distance = -T_ps[2, 3] / rays[..., 2]
    return distance, *(T_ps[i, 3] + distance * rays[..., i] for i in range(2))


def rectangle(T_rp: np.ndarray, size: tuple[float, float] = A4) -> np.ndarray:
    distance, x, y = on_plane(T_rp)
    return np.where((np.abs(x) < size[0] / 2) & (np.abs(y) < size[1] / 2), distance, np.nan)


def seen(distance: np.ndarray, vertices: int = 300) -> InitialDetection:
    return InitialDetection(distance.astype(np.float32), CAMERA, vertices)


def assert_is(found: Sheet, T_rp: np.ndarray, size: tuple[float, float], pixels: float = 0.5) -> None:
    """Asserts that the sheet is the same rectangle, up to the choice of its axes."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    true, there = (
        pose.transform(T, np.column_stack([corners * wh, np.zeros(4)]))
        for T, wh in ((T_rp, size), (found.T_rp, (found.width, found.height)))
    )
    nearest = np.linalg.norm(true[:, None] - there[None], axis=2).min(axis=1)
    assert nearest.max() < pixels * PIXEL * np.sqrt(2)


@pytest.mark.parametrize("turn", np.deg2rad([0, 3, 20, 44, 46, 70, 90, 135, 200]))
@pytest.mark.parametrize("tilt", [0.0, 0.5])
@pytest.mark.parametrize("size", [A4, (0.3, 0.2), (0.2, 0.2), (0.1, 0.25)])
def test_the_rectangle_is_found_to_half_a_pixel(turn, tilt, size):
    T_rp = placed(turn, tilt)
    found = find_sheet(seen(rectangle(T_rp, size)))
    assert_is(found, T_rp, size)
    assert pose.is_pose(found.T_rp)
    assert found.width >= found.height
    assert found.T_rp[:3, 2] @ CAMERA.T_rs[:3, 2] > 0


@pytest.mark.parametrize("degrees", range(-180, 181, 15))
def test_the_long_side_points_right_or_up_whatever_the_sheet_s_own_idea(degrees):
    found = find_sheet(seen(rectangle(placed(np.deg2rad(degrees + 1)))))
    right, down = CAMERA.T_rs[:3, :2].T @ found.T_rp[:3, 0]
    assert right - down > 0
    assert max(right, -down) > 0.7


def test_noise_spikes_and_a_finger_do_not_move_it():
    """5 mm of noise, 3 % outliers, and a finger over the rim that occludes 3 % of the sheet."""
    generator = np.random.default_rng(3)
    T_rp = placed(0.3, 0.3)
    distance = rectangle(T_rp)
    distance += generator.normal(0, 5e-3, distance.shape)
    spikes = generator.random(distance.shape) < 0.03
    distance[spikes] += generator.uniform(-0.3, 0.3, np.count_nonzero(spikes))
    _, x, y = on_plane(T_rp)
    finger = (np.abs(x - 0.05) < 0.01) & (y > 0.01) & (y < 0.13)
    distance[finger] = 0.8
    assert_is(find_sheet(seen(distance)), T_rp, A4, pixels=1.0)


def refused(distance: np.ndarray) -> str:
    with pytest.raises(DetectionError) as caught:
        find_sheet(seen(distance))
    return str(caught.value)


def test_a_disc_is_no_sheet():
    distance, x, y = on_plane(placed(0.2, 0.3))
    message = refused(np.where(np.hypot(x, y) < 0.12, distance, np.nan))
    assert "no rectangle" in message
    assert "a sheet minimum_overlap = 0.93 at least" in message


def test_a_sheet_behind_an_arm_is_not_taken_for_a_smaller_one():
    distance = rectangle(placed())
    distance[120:, 100:170] = np.nan
    assert "no rectangle" in refused(distance)


@pytest.mark.parametrize("direction", [0.0, 0.6])
def test_a_bent_sheet_is_not_yet_one(direction):
    distance, x, y = on_plane(placed())
    along = np.cos(direction) * x + np.sin(direction) * y
    bent = distance + np.where((np.abs(x) < 0.15) & (np.abs(y) < 0.1), 3.0 * along**2, np.nan)
    assert "must be flat to be found" in refused(bent)


def test_a_few_pixels_are_no_sheet():
    distance = np.full((240, 320), np.nan)
    distance[100:110, 100:115] = 1.0
    assert f"has 150 pixels, a sheet needs minimum_pixels = {LIMITS.minimum_pixels}" in refused(distance)


def test_nothing_is_no_sheet():
    assert "has 0 pixels" in refused(np.full((240, 320), np.nan))


def test_a_known_size_takes_the_place_of_the_detected_one():
    found = find_sheet(seen(rectangle(placed(0.1), (0.29, 0.2))))
    sheet = found.of_size(0.21, 0.297, 0.15)  # in any order
    assert (sheet.width, sheet.height) == (0.297, 0.21)
    np.testing.assert_array_equal(sheet.T_rp, found.T_rp)


def test_a_sheet_of_another_size_is_refused():
    detection = seen(rectangle(placed(), (0.25, 0.15)))
    with pytest.raises(DetectionError, match=r"0\.25\d m × 0\.15\d m, .* more than 15% from .* = 0\.297 m × 0\.21 m"):
        Settings(width_m=A4[0], height_m=A4[1]).build(detection)
    assert Settings(width_m=A4[0], height_m=A4[1], size_tolerance=0.4).build(detection).mesh.vertices.shape[1] == 3
    assert Settings().build(detection).mesh.vertices.shape[1] == 3


@pytest.mark.parametrize("vertices", [4, 30, 300, 2000])
@pytest.mark.parametrize("size", [A4, (1.0, 0.1)])
def test_the_mesh_is_a_grid_on_the_sheet(vertices, size):
    T_rp = placed(0.4, 0.2)
    mesh = Sheet(T_rp, *size).mesh(vertices)
    flat = pose.transform(pose.inverse(T_rp), mesh.vertices)
    rows, columns = (len(np.unique(mesh.chart[:, i])) for i in (1, 0))
    np.testing.assert_allclose(flat[:, 2], 0, atol=1e-12)
    np.testing.assert_allclose(flat[:, :2], ((mesh.chart + 0.5) / (columns, rows) - 0.5) * size, atol=1e-12)
    assert len(mesh.vertices) == rows * columns
    assert len(mesh.faces) == 2 * (rows - 1) * (columns - 1)
    assert 0.7 * vertices <= len(mesh.vertices) <= 1.3 * vertices or vertices == 4 or size[1] == 0.1
    assert np.all(mesh.normals @ T_rp[:3, 2] < -0.99)  # towards the sensor
    assert np.isnan(mesh.colors).all()


def test_a_sheet_is_seen_by_a_sensor_anywhere():
    """The rig's frame differs from the camera's: the result moves with the rig."""
    T = pose.from_rotation_vector([0.4, 0.5, -0.6], [1.0, 2.0, 3.0])
    here = find_sheet(seen(rectangle(placed(0.3, 0.2))))
    moved = dataclasses.replace(CAMERA, T_rs=T @ CAMERA.T_rs)
    there = find_sheet(dataclasses.replace(seen(rectangle(placed(0.3, 0.2))), camera=moved))
    np.testing.assert_allclose(there.T_rp, T @ here.T_rp, atol=1e-6)
