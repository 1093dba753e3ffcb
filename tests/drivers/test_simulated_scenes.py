"""Scenes of several things: two sheets that stay apart, each with a truth of its own."""

import numpy as np
import pytest

from drivers.device import DeviceState, Truth
from drivers.frame import Frame
from drivers.simulated.address import parse
from drivers.simulated.device import SimulatedDevice
from drivers.simulated.simulation import Simulation


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


def test_each_sheet_of_a_pair_moves_and_looks_its_own_way() -> None:
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


class Log:
    """A sink that keeps the truths and stops the device."""

    def __init__(self) -> None:
        self.truths: list[Truth] = []

    def on_truth(self, truth: Truth) -> None:
        self.truths.append(truth)

    def on_frame(self, frame: Frame) -> None: ...

    def on_state(self, state: DeviceState, reason: str) -> None: ...


def test_the_device_tells_the_truth_about_both() -> None:
    log = Log()
    simulation = build("pair", "sensors=tof&tof=32x24")
    waits = iter([False, True])
    device = SimulatedDevice("", simulation, lambda: 0, lambda stop, seconds: next(waits))
    device.start(log)
    device._thread.join(60)
    assert [(truth.seq, truth.surface) for truth in log.truths] == [(0, 0), (0, 1)]
