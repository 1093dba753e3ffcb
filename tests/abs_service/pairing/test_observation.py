"""Frames become what the tracker compares with: radial distances, RGB, and no silent mismatch of sizes."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.pairing.images import ColorImage, DepthImage
from abs_service.pairing.observation import ObservationError
from abs_service.tracking.observer import Observer
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.images.color import GaussianColor
from calib.noise.measured import Measured
from calib.noise.per_pixel import PerPixel
from calib.noise.structured_light import StructuredLight
from calib.rig import Rig, Sensor
from drivers.contract.frame import Frame, FrameSet, Geometry, Kind

CAMERA = Camera(6, 4, 5.0, 5.0, 2.5, 1.5, Lens(np.array([-0.1])), pose.from_rotation_vector([0, 1, 0], [1, 2, 3]))
RIG = Rig(
    "r",
    {
        "tof": Sensor("tof", CAMERA, GaussianPolynomial(((1e-3, 1e-7),))),
        "light": Sensor("light", CAMERA, StructuredLight()),
        "color": Sensor("color", CAMERA, GaussianColor()),
    },
)


def depth(sensor="tof", geometry=Geometry.RADIAL, size=(4, 6), seq=7) -> Frame:
    data = np.arange(1000, 1000 + size[0] * size[1], dtype="<u2").reshape(size)
    data[1, 2] = 0
    return Frame(sensor, "depth", Kind.DEPTH, data, "16UC1", 50, 60, seq, scale=1e-3, geometry=geometry, invalid=0)


def amplitude(size=(4, 6)) -> Frame:
    return Frame("tof", "amplitude", Kind.AMPLITUDE, np.full(size, 300, "<u2"), "16UC1", 50, 60, 7)


def color(encoding="rgb8") -> Frame:
    pixels = np.tile(np.array([10, 20, 30], np.uint8), (4, 6, 1))
    return Frame("color", "color", Kind.COLOR, pixels, encoding, 51, 60, 8)


def observe(*frames: Frame):
    return Observer(RIG).observe(FrameSet(3, 50, {frame.key: frame for frame in frames}))


def test_radial_distances_stay_as_they_are():
    image = observe(depth(), amplitude()).images["tof"]
    assert isinstance(image, DepthImage)
    expected = np.arange(1000, 1024).reshape(4, 6) * 1e-3
    expected[1, 2] = np.nan
    np.testing.assert_allclose(image.distance, expected, rtol=1e-6)
    assert np.all(image.amplitude == 300)


def test_z_becomes_radial():
    """The unprojected points then have the z, in the sensor's frame, that was measured."""
    image = observe(depth("light", Geometry.Z)).images["light"]
    assert isinstance(image, DepthImage)
    z = pose.transform(CAMERA.T_sr, CAMERA.unproject(image.distance))[..., 2]
    expected = np.arange(1000, 1024).reshape(4, 6) * 1e-3
    expected[1, 2] = np.nan
    np.testing.assert_allclose(z, expected, rtol=1e-6)
    assert image.distance[0, 0] > 1.05


@pytest.mark.parametrize(("sensor", "geometry"), [("tof", Geometry.RADIAL), ("light", Geometry.Z)])
def test_systematic_errors_of_distances_are_taken_off(sensor, geometry):
    """measured = (1 + scale) · distance + offset."""
    frames = FrameSet(3, 50, {frame.key: frame for frame in (depth(sensor, geometry), amplitude())})
    plain = Observer(RIG).observe(frames).images[sensor]
    terms = replace(RIG.sensors[sensor], depth_offset=0.02, depth_scale=0.01)
    image = Observer(Rig("r", {sensor: terms})).observe(frames).images[sensor]
    assert isinstance(plain, DepthImage)
    assert isinstance(image, DepthImage)
    np.testing.assert_allclose(1.01 * image.distance + 0.02, plain.distance, rtol=1e-6)


def test_a_depth_sensor_without_amplitudes_has_none():
    image = observe(depth("light")).images["light"]
    assert isinstance(image, DepthImage)
    assert np.isnan(image.amplitude).all()


@pytest.mark.parametrize(("encoding", "expected"), [("rgb8", [10, 20, 30]), ("bgr8", [30, 20, 10])])
def test_colors_are_red_green_blue(encoding, expected):
    image = observe(color(encoding)).images["color"]
    assert isinstance(image, ColorImage)
    assert image.rgb[2, 3].tolist() == expected


def test_what_did_not_come_is_missing():
    seen = observe(depth(), amplitude(), color())
    assert seen.missing == ("light",)
    assert (seen.seq, seen.t_host_ns) == (3, 50)
    assert {name: (source.seq, source.t_host_ns) for name, source in seen.sources.items()} == {
        "tof": (7, 50),
        "color": (8, 51),
    }


def test_without_the_amplitude_that_its_noise_model_needs_a_sensor_is_missing():
    assert observe(depth(), color()).missing == ("tof", "light")


def deviation(sensor: str) -> Frame:
    data = np.full((4, 6), 2, "<u2")
    data[0, 1] = 0
    return Frame(sensor, "deviation", Kind.DEVIATION, data, "16UC1", 50, 60, 7, scale=1e-3, invalid=0)


OWN = PerPixel(Measured(), np.zeros((1, 4, 6)), np.ones((4, 6)), np.array([0.5, 3.0]))


@pytest.mark.parametrize("noise", [Measured(), OWN])
@pytest.mark.parametrize(("sensor", "geometry"), [("tof", Geometry.RADIAL), ("light", Geometry.Z)])
def test_the_sensor_s_own_deviations_come_with_its_distances_and_are_converted_as_they_are(noise, sensor, geometry):
    rig = Rig("r", {sensor: replace(RIG.sensors[sensor], noise=noise, depth_offset=0.02, depth_scale=0.25)})
    frames = [depth(sensor, geometry), deviation(sensor), amplitude()]
    image = Observer(rig).observe(FrameSet(3, 50, {frame.key: frame for frame in frames})).images[sensor]
    assert isinstance(image, DepthImage)
    share = image.amplitude / (image.distance + 0.02 / 1.25)  # of the measurement, whatever the conversion
    expected = 2 / np.arange(1000, 1024).reshape(4, 6)
    expected[[0, 1], [1, 2]] = np.nan
    np.testing.assert_allclose(share, expected, rtol=1e-5)
    assert Observer(rig).observe(FrameSet(3, 50, {frame.key: frame for frame in (frames[0], frames[2])})).missing


def test_an_empty_set_misses_everything():
    assert observe().missing == ("tof", "light", "color")


@pytest.mark.parametrize("frames", [(depth(size=(5, 6)),), (depth(), amplitude(size=(4, 5)))])
def test_another_size_than_the_camera_s_is_named(frames):
    with pytest.raises(ObservationError, match=r"tof/\w+ is . × . pixels, but .* sensors\.tof is for 6 × 4"):
        observe(*frames)
