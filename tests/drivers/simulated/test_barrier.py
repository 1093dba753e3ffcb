"""The light barrier: detection of bodies in the beam, and declared error rates."""

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header

from drivers.contract.frame import Frame, Kind
from drivers.encoding import codec
from drivers.simulated.address import parse
from drivers.simulated.scene.scene import Moment
from drivers.simulated.sensors.barrier import Barrier, BarrierNoise
from drivers.simulated.simulation import Simulation


def build(query: str) -> tuple[Simulation, Barrier]:
    simulation = parse(f"simulated://sheet?sensors=barrier&{query}").build()
    barrier = simulation.heads["barrier"]
    assert isinstance(barrier, Barrier)
    return simulation, barrier


def report(simulation: Simulation, k: int) -> Frame:
    (frame,), _ = simulation.expose(k)
    return frame


def distance_from_beam(barrier: Barrier, points_r: np.ndarray) -> float:
    """Smallest distance of some points from the straight line between lamp and receiver [m]."""
    camera = barrier.camera
    along = np.clip((points_r - camera.center) @ camera.T_rs[:3, 2], 0, barrier.length_m)
    return float(np.linalg.norm(points_r - camera.center - along[..., None] * camera.T_rs[:3, 2], axis=-1).min())


def test_it_is_interrupted_where_the_sheet_is_in_the_beam() -> None:
    simulation, barrier = build("seed=1")
    certain = []
    for t in np.arange(0, 20, 0.25):
        moment = simulation.scene.at(t)
        points = moment.surfaces[0].grid(101, 151)
        inside = distance_from_beam(barrier, points[2:-2, 2:-2]) < 2e-3
        outside = distance_from_beam(barrier, points) > 2e-3
        certain += [barrier.interrupted(moment) == inside] if inside or outside else []
    assert all(certain)
    assert len(certain) > 70


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_is_free_at_rest_and_interrupted_during_motion(seed: int) -> None:
    simulation, barrier = build(f"seed={seed}")
    assert not barrier.interrupted(simulation.scene.at(0.5))
    states = [barrier.interrupted(simulation.scene.at(t)) for t in np.arange(4, 24, 0.2)]
    assert 0.25 < np.mean(states) < 0.75
    assert np.count_nonzero(np.diff(states)) >= 4


def test_a_hand_interrupts_it_as_well() -> None:
    simulation, barrier = build("seed=1&occluder=hand")
    moments = [simulation.scene.at(t) for t in np.arange(0, 20, 0.1)]
    by_hand = [barrier.interrupted(moment) and not barrier.interrupted(Moment(moment.surfaces)) for moment in moments]
    assert not any(by_hand[:10])
    assert 3 < sum(by_hand) < 60


def test_the_error_rates_are_as_declared() -> None:
    simulation, barrier = build("seed=5&noise=10&speed=2")
    assert barrier.noise == BarrierNoise(miss=0.1, false_alarm=0.1)
    exposures = range(120, 1320, 2)
    truth = np.array([barrier.interrupted(simulation.scene.at(k / 30)) for k in exposures])
    reported = np.array([report(simulation, k).data[0, 0] == 255 for k in exposures])
    misses, alarms = ~reported[truth], reported[~truth]
    assert misses.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / misses.size))
    assert alarms.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / alarms.size))


def test_without_noise_it_never_errs() -> None:
    simulation, barrier = build("seed=2&noise=0")
    for k in range(120, 300, 7):
        assert report(simulation, k).si()[0, 0] == float(barrier.interrupted(simulation.scene.at(k / 30)))


def test_its_frame_is_one_binary_pixel_and_round_trips() -> None:
    simulation, barrier = build("seed=1")
    frame = report(simulation, 130)
    assert (frame.kind, frame.encoding, frame.unit, frame.data.shape) == (Kind.BINARY, "mono8", "1", (1, 1))
    assert set(np.unique([report(simulation, k).si()[0, 0] for k in range(120, 220, 5)])) == {0.0, 1.0}
    (stream,) = barrier.streams
    assert (stream.sensor, stream.stream, stream.width, stream.height) == ("barrier", "binary", 1, 1)
    again = codec.decode(codec.encode_image(frame, 0), codec.encode_info(frame, Header()))
    assert (again.kind, again.unit, again.scale, again.data.tolist()) == (
        frame.kind,
        frame.unit,
        frame.scale,
        frame.data.tolist(),
    )
