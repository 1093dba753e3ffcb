"""The lookup of a sensor is the inverse of its projection all over the image, or says where there is none."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib.camera import Camera
from calib.lenses import lookup
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens, LensError

LENSES = {
    "pinhole": Lens(),
    "webcam": Lens(np.array([-0.28, 0.07, 1e-3, -5e-4])),
    "five": Lens(np.array([0.09, -0.25, -1e-3, 2e-3, 0.11])),
    "rational": Lens(np.array([5.2, 3.4, -1e-4, 2e-5, 0.18, 5.5, 5.1, 0.95])),
    "fisheye": KannalaBrandt(np.array([0.05, -0.01, 3e-3, -1e-3])),
}


@pytest.mark.parametrize("name", LENSES)
def test_every_pixel_looks_where_opencv_s_projection_takes_back_to_it(name):
    lens = LENSES[name]
    camera = Camera(320, 240, 210.0, 215.0, 161.3, 118.2, lens)
    points = camera.lookup.rays.reshape(-1, 3)
    K = np.array([[210.0, 0, 161.3], [0, 215.0, 118.2], [0, 0, 1]])
    if name == "fisheye":
        place = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), K, lens.coefficients)[0][0]
    else:
        place = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, lens.coefficients)[0][:, 0]
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    assert np.abs(place - np.column_stack([columns.ravel(), rows.ravel()])).max() < lookup.ACCURACY_PX
    np.testing.assert_allclose(camera.lookup.ray_length * camera.lookup.rays[..., 2], 1, rtol=1e-14)


@settings(max_examples=25)
@given(st.lists(st.floats(-0.4, 0.4), min_size=1, max_size=3), st.booleans())
def test_a_lookup_is_accurate_or_tells_where_it_is_not(numbers, is_fisheye):
    lens = KannalaBrandt(np.array(numbers)) if is_fisheye else Lens(np.array(numbers))
    camera = Camera(40, 30, 16.0, 16.0, 19.5, 14.5, lens)
    columns, rows = np.meshgrid(np.arange(40), np.arange(30))
    pixels = np.stack([columns, rows], axis=-1)
    try:
        ideal = camera.lookup.ideal
    except LensError as error:
        column, row = (int(number) for number in str(error).split("(column, row) = (")[1].split(")")[0].split(","))
        with pytest.raises(LensError):
            camera.directions(np.array([column, row]))
        radius = np.linalg.norm(pixels - (19.5, 14.5), axis=-1)
        inside = radius < np.hypot(column - 19.5, row - 14.5) - 1e-9
        assert np.isfinite(camera.directions(pixels[inside])).all()
        return
    place = lens.distort(ideal) * 16.0 + (19.5, 14.5)
    assert np.linalg.norm(place - pixels, axis=-1).max() < lookup.ACCURACY_PX


def test_the_error_names_the_pixel_and_the_radius():
    barrel = Camera(128, 96, 60.0, 60.0, 63.5, 47.5, Lens(np.array([-0.4])))  # r (1 − 0.4 r²) is at most 0.609
    with pytest.raises(LensError, match=r"brown_conrady .* at \d+ of 12288 pixels, .* from a radius of 36\.\d px"):
        _ = barrel.lookup
    hemisphere = Camera(128, 96, 45.0, 45.0, 63.5, 47.5, KannalaBrandt())
    with pytest.raises(LensError, match=r"fisheye .* from a radius of 70\.\d px"):  # 45 px · π / 2 = 70.7 px
        hemisphere.rays()


def test_a_lookup_is_built_once_and_cannot_be_written_to():
    camera = Camera(32, 24, 40.0, 40.0, 15.5, 11.5, LENSES["webcam"])
    assert camera.lookup is camera.lookup
    with pytest.raises(ValueError, match="read-only"):
        camera.lookup.ideal[0, 0, 0] = 1.0
    camera.rays()[:] = 0  # whoever asks for rays gets their own
    np.testing.assert_allclose(np.linalg.norm(camera.rays(), axis=-1), 1)
