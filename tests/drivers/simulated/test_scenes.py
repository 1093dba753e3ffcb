"""Scenes with two sheets, and excursions."""

import numpy as np
import pytest

from drivers.simulated.address import parse
from drivers.simulated.device import SimulatedDevice
from drivers.simulated.simulation import Simulation
from tests.drivers.recording_sink import RecordingSink


def build(scene: str, query: str) -> Simulation:
    return parse(f"simulated://{scene}?{query}").build()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("bend", [60, 90])
def test_the_sheets_of_a_pair_stay_apart_and_in_view(seed: int, bend: int) -> None:
    simulation = build("pair", f"seed={seed}&bend={bend}&sensors=tof,color")
    for t in np.arange(0, 20, 0.5):
        grids = [surface.grid(9, 13) for surface in simulation.scene.at(t).surfaces]
        for head in simulation.heads.values():
            left, right = (head.camera.project(grid) for grid in grids)
            assert left[..., 0].max() + 4 < right[..., 0].min()
            assert left.min() > 0
            assert right[..., 0].max() < head.camera.width - 1


def test_paper_is_white_with_dots_of_ink_before_a_grey_wall() -> None:
    (frame,) = build("sheet", "texture=paper&sensors=color&noise=0&color=640x480").frames(0)
    middle = frame.data[200:280, 230:350].reshape(-1, 3).astype(int)
    white = (middle.min(axis=1) > 180).mean()
    colored = (np.ptp(middle, axis=1) > 60).mean()
    assert white > 0.5
    assert 0.1 < colored < 0.4
    assert np.ptp(frame.data[:100].astype(int), axis=-1).max() < 30


def test_each_sheet_of_a_pair_has_its_own_motion_and_texture() -> None:
    simulation = build("pair", "sensors=color&noise=0&color=640x480")
    moved = [[truth.points_r for truth in simulation.truths(k)] for k in (0, 150)]
    steps = [after - before for before, after in zip(*moved)]
    assert np.linalg.norm(steps[0] - steps[1], axis=-1).mean() > 0.01
    image, camera = simulation.frames(0)[0].data, simulation.heads["color"].camera
    looks = []
    for points in moved[0]:
        u, v = np.moveaxis(np.floor(camera.project(points) + 0.5).astype(int), -1, 0)
        looks.append(image[v, u].astype(float).ravel())
    assert abs(np.corrcoef(looks)[0, 1]) < 0.5


@pytest.mark.parametrize("k", [0, 120, 240])
def test_time_of_flight_measures_both_truths(k: int) -> None:
    simulation = build("pair", "sensors=tof&noise=0&tof=352x288")
    frames, first = simulation.expose(k)
    truths, camera = simulation.truths(k), simulation.heads["tof"].camera
    assert [truth.surface for truth in truths] == [0, 1]
    np.testing.assert_array_equal(first.points_r, truths[0].points_r)
    for truth in truths:
        points = truth.points_r[2:-2, 2:-2].reshape(-1, 3)
        u, v = np.floor(camera.project(points) + 0.5).astype(int).T
        away = np.abs(frames[0].si()[v, u] - camera.distance(points))
        assert np.median(away) < 5e-4
        assert np.max(away) < 4e-3


def test_the_device_delivers_the_truth_of_both() -> None:
    sink = RecordingSink()
    simulation = build("pair", "sensors=tof&tof=32x24")
    waits = iter([False, True])
    device = SimulatedDevice("", simulation, lambda: 0, lambda stop, seconds: next(waits))
    device.start(sink)
    sink.wait(lambda: len(sink.truths) == 2, 60)
    assert [(truth.seq, truth.surface) for truth in sink.truths] == [(0, 0), (0, 1)]


@pytest.mark.parametrize("scene", ["sheet", "board", "pair", "strip"])
def test_a_leaving_surface_is_out_of_every_view_in_the_interval(scene: str) -> None:
    heads = "sensors=tof,structured_light,color,bayer,ir,barrier&noise=0&lens=-0.25,0.06"
    simulation, original = build(scene, f"{heads}&leave=3,5"), build(scene, heads)
    empty = {frame.key: frame.data for frame in simulation.frames(121)}
    for k in (91, 120, 149):
        gone = {frame.key: frame.data for frame in simulation.frames(k)}
        for key, image in gone.items():
            np.testing.assert_array_equal(image, empty[key])
        assert gone["barrier", "binary"] == 0
        for before, after in zip(original.truths(k), simulation.truths(k)):
            np.testing.assert_allclose(
                after.points_r - before.points_r, np.broadcast_to((1.2, 0, 0), (21, 31, 3)), atol=1e-6
            )
    for k in (0, 70, 163, 200):
        for frame, expected in zip(simulation.frames(k), original.frames(k)):
            np.testing.assert_array_equal(frame.data, expected.data)


@pytest.mark.parametrize("scene", ["sheet", "board", "pair"])
def test_a_turn_is_a_right_angle_in_a_quarter_of_a_second(scene: str) -> None:
    turning, original = build(scene, "sensors=tof&turn=4&seed=2"), build(scene, "sensors=tof&seed=2")
    for t, share in ((3.99, 0), (4.125, 0.5), (4.26, 1), (9, 1)):
        for surface, expected in zip(turning.scene.at(t).surfaces, original.scene.at(t).surfaces):
            grids = surface.grid(3, 3), expected.grid(3, 3)
            right, before = (grid[1, 2] - grid[1, 0] for grid in grids)
            cosine = right @ before / np.linalg.norm(right) / np.linalg.norm(before)
            assert np.arccos(np.clip(cosine, -1, 1)) == pytest.approx(share * np.pi / 2, abs=0.02 if share < 1 else 0.2)
            np.testing.assert_allclose(grids[0][1, 1], grids[1][1, 1], atol=0.02)
    right = turning.scene.at(9).surfaces[0].grid(3, 3)[1]
    assert (right[2] - right[0])[1] > 0.1  # clockwise: what was on the right is below


def test_a_sheet_that_turned_fits_into_the_view() -> None:
    simulation = build("sheet", "sensors=tof&turn=4")
    for t in np.arange(4.25, 20, 0.5):
        points = simulation.heads["tof"].camera.project(simulation.scene.at(t).surfaces[0].grid(9, 13))
        assert points.min() > -0.5
        assert points[..., 1].max() < 143.5
