"""Area of the pixels and blur of the lens of colour heads, on prints that are sharper than a pixel."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from drivers.simulated.address import parse
from drivers.simulated.sensors.color import Picture

#: A moment in which the board is turned, so that its edges cross the pixels at an angle [s].
MOMENT = 3.3


@pytest.mark.parametrize("blur", [0.5, 1.5])
def test_blur_is_a_gaussian(blur: float) -> None:
    simulation = parse("simulated://board?sensors=color").build()
    camera, moment = simulation.heads["color"].camera, simulation.scene.at(MOMENT)
    sharp, blurred = (Picture(camera, simulation.scene, 2, one).take(moment) for one in (0.0, blur))
    assert np.abs(blurred - sharp).max() > 10
    np.testing.assert_allclose(blurred, gaussian_filter(sharp, (blur, blur, 0), mode="nearest"), atol=0.5)


def test_a_sharp_print_is_seen_by_the_area_of_the_pixels_through_a_lens() -> None:
    simulation = parse("simulated://board?sensors=color&noise=0").build()
    camera, moment = simulation.heads["color"].camera, simulation.scene.at(MOMENT)
    true = Picture(camera, simulation.scene, 8, 0.5).take(moment)
    (frame,) = simulation.frames(round(MOMENT * simulation.rate_hz))
    points = Picture(camera, simulation.scene).take(moment)  # one ray through the centre of each pixel
    assert np.quantile(np.abs(np.asarray(frame.data, np.float32) - true), 0.999) < 5
    assert np.quantile(np.abs(points - true), 0.999) > 25


@pytest.mark.parametrize(("address", "same"), [("board?blur=0.5", True), ("board?blur=0", False)])
def test_the_lens_is_as_sharp_as_the_address_says(address: str, same: bool) -> None:
    one, other = (parse(f"simulated://{uri}").build().frames(99)[-1].data for uri in ("board", address))
    assert np.array_equal(one, other) == same
