"""The bare wall: pose in every head, and declared noise models."""

import numpy as np
import pytest

from drivers.contract.device import AddressError
from drivers.simulated.address import parse
from drivers.simulated.sensors.time_of_flight import WIGGLE_M, TimeOfFlight


def build(query: str):
    return parse(f"simulated://wall?{query}").build()


@pytest.mark.parametrize("tilt", [-30.0, 0.0, 45.0])
@pytest.mark.parametrize("head", ["tof", "structured_light"])
def test_every_distance_lies_on_the_plane(head: str, tilt: float) -> None:
    simulation = build(f"distance=1.3&tilt={tilt}&noise=0&reflectivity=0.9&sensors={head}")
    camera, depth = simulation.heads[head].camera, simulation.frames(0)[0]
    rays = camera.rays()
    distance = depth.si() if head == "tof" else depth.si() / rays[..., 2]
    normal = np.array([np.sin(np.deg2rad(tilt)), 0, np.cos(np.deg2rad(tilt))])
    off = (camera.unproject(distance) - (0, 0, 1.3)) @ normal
    assert np.isfinite(off).mean() > 0.99
    assert np.nanmax(np.abs(off)) < (4e-4 if head == "tof" else 8e-3)


def test_the_amplitude_is_that_of_the_reflectivity() -> None:
    amplitudes = [build(f"reflectivity={r}&noise=0&sensors=tof").frames(0)[1].si() for r in (0.2, 0.8)]
    assert amplitudes[0][72, 88] == pytest.approx(2000, rel=2e-3)
    np.testing.assert_allclose(amplitudes[1] / amplitudes[0], 4, rtol=2e-3)


def test_wiggling_amplitude_dependent_and_fixed_pattern_offsets() -> None:
    simulation = build("noise=0&offset=0.01&wiggle=0.005&dark=-8&pattern=0.003&reflectivity=0.6&sensors=tof&seed=5")
    head = simulation.heads["tof"]
    assert isinstance(head, TimeOfFlight)
    distance, amplitude = head.ideal(())
    law = 0.01 + 0.005 * np.sin(2 * np.pi * distance / WIGGLE_M) - 8 / amplitude
    pattern = simulation.frames(0)[0].si() - distance - law
    assert pattern.std() == pytest.approx(0.003, rel=0.05)
    other = build("noise=0&pattern=0.003&sensors=tof&seed=6&distance=2").heads["tof"]
    assert isinstance(other, TimeOfFlight)
    np.testing.assert_allclose(pattern, other.pattern, atol=2e-4)  # the sensor's, whatever it looks at


def test_the_scene_is_static_without_tracked_surfaces() -> None:
    simulation = build("noise=0")
    assert simulation.truths(100) == []
    for early, late in zip(simulation.frames(0), simulation.frames(500), strict=True):
        np.testing.assert_array_equal(early.data, late.data)


@pytest.mark.parametrize("query", ["wall?occluder=hand", "wall?speed=2", "sheet?tilt=3", "board?distance=2"])
def test_keys_of_another_scene_are_errors(query: str) -> None:
    with pytest.raises(AddressError, match="means nothing in"):
        parse(f"simulated://{query}")
