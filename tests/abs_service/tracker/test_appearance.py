"""Appearance of the vertices, sampled per sensor in the images from which the mesh is made."""

import numpy as np
import pytest

from abs_service.pairing.images import BAYER_ORDERS, ONE_CHANNEL, ChannelImage, ColorImage, Image
from abs_service.tracker.appearance import with_appearance
from abs_service.tracker.mesh import Mesh
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.noise.constant import Constant
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.noise.images.grey import GaussianGrey
from calib.noise.images.intensity import GaussianIntensity
from calib.rig import Noise, Rig, Sensor
from tests.abs_service.tracker.scenes import depth_image, flat, sheet

T_RS = pose.from_rotation_vector([0.1, -0.2, 0.05], [0.1, 0.2, -0.3])
CAMERA = Camera(320, 240, 275.0, 275.0, 159.5, 119.5, T_rs=T_RS)
COLUMNS, ROWS = np.meshgrid(np.arange(320.0), np.arange(240.0))
#: Linear in the image, so that every interpolation is exact.
RAMPS = np.stack([COLUMNS / 2, ROWS, 255 - ROWS], axis=-1)
CROSSTALK = ((0.8, 0.15, 0.05), (0.1, 0.8, 0.1), (0.0, 0.2, 0.8))


def mesh_before(camera: Camera = CAMERA) -> Mesh:
    """A flat sheet one metre before a camera."""
    mesh = sheet(height=flat)
    return Mesh(pose.transform(camera.T_rs, mesh.vertices), mesh.faces, mesh.colors, mesh.chart)


def rig(**noises: Noise) -> Rig:
    return Rig("r", {name.replace("_", "/"): Sensor(name, CAMERA, noise) for name, noise in noises.items()})


def ramps(mesh: Mesh) -> np.ndarray:
    columns, rows = CAMERA.project(mesh.vertices).T
    return np.stack([columns / 2, rows, 255 - rows], axis=-1)


def mosaic(order: str, levels: np.ndarray = RAMPS) -> ChannelImage:
    image = ChannelImage(np.zeros((240, 320), np.float32), BAYER_ORDERS[order])
    values = np.take_along_axis(levels, image.channel[..., None].astype(int), axis=2)[..., 0]
    return ChannelImage(values.astype(np.float32), BAYER_ORDERS[order])


def seen(image: Image, noise: Noise) -> np.ndarray:
    mesh = mesh_before()
    return with_appearance(mesh, {"camera": image}, rig(camera=noise)).appearance_of("camera")


def test_a_color_sensor_sees_its_own_colors_between_the_pixels():
    mesh = mesh_before()
    result = with_appearance(mesh, {"color": ColorImage(np.rint(RAMPS).astype(np.uint8))}, rig(color=GaussianColor()))
    np.testing.assert_allclose(result.colors, ramps(mesh), atol=0.51)
    np.testing.assert_array_equal(result.appearance_of("color"), result.colors)


@pytest.mark.parametrize("order", BAYER_ORDERS)
def test_every_channel_of_a_mosaic_is_read_on_its_own_lattice(order):
    np.testing.assert_allclose(seen(mosaic(order), GaussianBayer()), ramps(mesh_before()), atol=1e-3)


def test_grey_and_passive_intensity_are_what_the_image_shows():
    image = ChannelImage(RAMPS[..., 1].astype(np.float32), ONE_CHANNEL)
    for noise in (GaussianGrey(), GaussianIntensity("ir", 5.0, illumination="passive")):
        np.testing.assert_allclose(seen(image, noise), ramps(mesh_before())[:, 1:2], atol=1e-3)


def test_active_light_is_divided_out():
    """A uniform board before a lamp: the reflectivity is the same everywhere, though its rim looks darker."""
    mesh = mesh_before()
    rays = CAMERA.rays()
    distance = 1 / rays[..., 2]  # of the plane z = 1 m in the sensor's frame
    image = ChannelImage((3000 * rays[..., 2] / distance**2).astype(np.float32), ONE_CHANNEL)
    appearance = with_appearance(mesh, {"tof": image}, rig(tof=GaussianIntensity("amplitude", 10.0))).appearance_of(
        "tof"
    )
    np.testing.assert_allclose(appearance, 3000, rtol=2e-4)


def test_crosstalk_is_done_to_the_colors_of_a_color_sensor():
    mesh, noise = mesh_before(), GaussianBayer(crosstalk=CROSSTALK)
    images = {"color": ColorImage(np.rint(RAMPS).astype(np.uint8)), "raw": mosaic("rggb", np.zeros_like(RAMPS))}
    result = with_appearance(mesh, images, rig(color=GaussianColor(), raw=noise))
    np.testing.assert_allclose(result.appearance_of("raw"), result.colors @ np.array(CROSSTALK).T, atol=1e-3)


def test_crosstalk_is_in_the_mosaic_that_the_colors_come_from_and_not_in_the_colors():
    mesh, noise = mesh_before(), GaussianBayer(crosstalk=CROSSTALK)
    result = with_appearance(mesh, {"raw": mosaic("gbrg", RAMPS @ np.array(CROSSTALK).T)}, rig(raw=noise))
    np.testing.assert_allclose(result.appearance_of("raw"), ramps(mesh) @ np.array(CROSSTALK).T, atol=1e-3)
    np.testing.assert_allclose(result.colors, ramps(mesh), atol=1e-3)


def test_defocus_is_done_to_the_colors_of_a_color_sensor():
    """Stripes of two pixels vanish in a sensor that blurs by three, and stay in one that does not."""
    mesh = mesh_before()
    stripes = np.repeat((100 + 100 * (COLUMNS % 4 < 2))[..., None], 3, axis=2)
    images = {"color": ColorImage(stripes.astype(np.uint8))}
    sharp, soft = (
        with_appearance(mesh, images, rig(color=GaussianColor(), raw=GaussianBayer(defocus_px=px))).appearance_of("raw")
        for px in (0.0, 3.0)
    )
    assert np.std(sharp[:, 0]) > 20
    assert np.std(soft[:, 0]) < 2
    np.testing.assert_allclose(soft.mean(), 150, atol=2)


def test_a_sensor_that_saw_nothing_takes_the_colors_of_the_others():
    mesh = mesh_before()
    images = {"color": ColorImage(np.rint(RAMPS).astype(np.uint8))}
    noises = {"color": GaussianColor(), "second": GaussianColor(), "grey": GaussianGrey(), "raw": GaussianBayer()}
    result = with_appearance(mesh, images, rig(**noises, ir=GaussianIntensity("ir", 5.0)))
    for name in ("second", "raw"):
        np.testing.assert_array_equal(result.appearance_of(name), result.colors)
    np.testing.assert_allclose(result.appearance_of("grey")[:, 0], result.colors @ [0.299, 0.587, 0.114], rtol=1e-5)
    assert np.isnan(result.appearance_of("ir")).all()  # colours tell nothing of infra-red
    assert result.appearance_of("ir").shape == (len(mesh.vertices), 1)


def test_colors_of_several_sensors_are_averaged_but_each_is_compared_with_its_own():
    mesh = mesh_before()
    images = {name: ColorImage(np.full((240, 320, 3), level, np.uint8)) for name, level in (("a", 100), ("b", 200))}
    result = with_appearance(mesh, images, rig(a=GaussianColor(), b=GaussianColor()))
    assert (result.colors.mean(), result.appearance_of("a").mean(), result.appearance_of("b").mean()) == (150, 100, 200)


def test_without_a_picture_there_are_no_colors():
    mesh = mesh_before()
    result = with_appearance(
        mesh, {"tof": depth_image(np.ones((240, 320)))}, rig(tof=Constant(0.01), color=GaussianColor())
    )
    assert np.isnan(result.colors).all()
    assert result.colors.shape == (len(mesh.vertices), 3)
    assert "tof" not in result.appearance


@pytest.mark.parametrize("point", [[0, 3, 1], [0, 0, -1], [1.66, 0, 1]], ids=["aside", "behind", "folded"])
def test_what_is_out_of_sight_has_no_color(point):
    """A barrel's polynomial folds what is far aside back into the image; no light reaches the sensor from there."""
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, Lens(np.array([-0.3])))
    points = np.array([point, [0.1, 0.05, 1.0]])
    mesh = Mesh(points, np.zeros((0, 3), np.int32), np.zeros((2, 3), np.float32), np.zeros((2, 2)))
    image = ColorImage(np.full((48, 64, 3), 80, np.uint8))
    colors = with_appearance(mesh, {"c": image}, Rig("r", {"c": Sensor("c", camera, GaussianColor())})).colors
    assert np.isnan(colors[0]).all()
    np.testing.assert_array_equal(colors[1], 80)


def test_what_the_image_does_not_know_is_not_taken_for_black():
    values = np.full((240, 320), 90, np.float32)
    values[::2] = np.nan
    looks = seen(ChannelImage(values, ONE_CHANNEL), GaussianGrey())
    assert np.isfinite(looks).mean() > 0.5  # the others lie on a row that is unknown
    np.testing.assert_array_equal(looks[np.isfinite(looks)], 90)
    assert np.isnan(seen(ChannelImage(np.full_like(values, np.nan), ONE_CHANNEL), GaussianGrey())).all()


def test_appearance_follows_the_vertices_when_they_are_reordered():
    mesh = with_appearance(mesh_before(), {"raw": mosaic("rggb")}, rig(raw=GaussianBayer()))
    order = np.random.default_rng(1).permutation(len(mesh.vertices))
    np.testing.assert_array_equal(mesh.reordered(order).appearance_of("raw"), mesh.appearance_of("raw")[order])
