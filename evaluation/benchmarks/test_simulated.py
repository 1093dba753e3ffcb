"""Time of an exposure of the simulated device, which shares two cores with the tracker in a live rig."""

import pytest

from tests.abs_service.tracking.driving import simulate

#: Exposure at which everything is in view.
SHOWN = 135

ADDRESSES = {
    "sheet": "simulated://sheet",
    "sheet with a hand": "simulated://sheet?occluder=hand",
    "pair": "simulated://pair",
    "strip": "simulated://strip",
    "tof": "simulated://sheet?sensors=tof",
    "color": "simulated://sheet?sensors=color",
    "structured_light": "simulated://sheet?sensors=structured_light",
    "ir": "simulated://sheet?sensors=ir",
    "bayer 640x480, fine": "simulated://sheet?sensors=bayer&bayer=640x480&texture=fine",
    "barrier": "simulated://sheet?sensors=barrier",
}


@pytest.mark.parametrize("name", ADDRESSES)
def test_expose(benchmark, name):
    frames, _ = benchmark(simulate(ADDRESSES[name]).expose, SHOWN)
    assert len(frames) >= 1
