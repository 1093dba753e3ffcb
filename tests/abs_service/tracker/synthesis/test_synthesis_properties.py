"""Every synthesis matches the measurements of a sheet at any pose, and its gradients match the cost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.images import BAYER_ORDERS, ONE_CHANNEL, ChannelImage, ColorImage
from abs_service.tracker.models.rigid import Rigid
from abs_service.tracker.synthesis import dense, sparse, undistorted, warped
from abs_service.tracker.terms.base import Bounds, ObservedTerm, Prediction
from abs_service.tracker.terms.depth.depth import DepthTerm
from abs_service.tracker.terms.linearization import stack
from abs_service.tracker.terms.photometric.channel import ChannelTerm
from abs_service.tracker.terms.photometric.color import ColorTerm
from abs_service.tracker.terms.photometric.illumination import Passive
from abs_service.tracker.terms.photometric.observed_channel import ObservedChannel
from calib import pose
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.noise.constant import Constant
from calib.noise.images.bayer import GaussianBayer
from calib.noise.images.color import GaussianColor
from calib.noise.images.grey import GaussianGrey
from calib.rig import Rig, Sensor
from tests.abs_service.tracker.scenes import depth_image, flat, observation, plane_distance, sheet
from tests.abs_service.tracker.synthesis.test_synthesis import slope

KINDS = {
    "sparse": sparse.Settings(),
    "undistorted": undistorted.Settings(),
    "warped": warped.Settings(),
    "dense": dense.Settings(),
}
ALL = pytest.mark.parametrize("kind", KINDS)
LENS = Lens(np.array([-0.15, 0.03, 1e-3, -1e-3]))
TOF = Camera(160, 120, 300.0, 300.0, 79.5, 59.5, LENS)
PICTURE = Camera(160, 120, 300.0, 300.0, 79.5, 59.5, LENS, pose.look_at([0.05, 0, 0], [0.03, 0, 1.0]))
MESH = sheet(13, 19, flat, size=(0.2, 0.14))
DEPTH, LEVELS = Constant(0.01), 10.0
BOUNDS = Bounds(0.0, 5.0, 20.0)
#: Colours at the sheet's centre and their gradients over it [levels/m], two levels per pixel: the same in all channels,
#: so that a pixel's colour filter has no effect on a gradient, with offsets between the channels.
TINTS, GRADIENTS = np.array([100.0, 128.0, 160.0]), np.array([450.0, -350.0])


def tints(points: np.ndarray) -> np.ndarray:
    """Red, green and blue of material points (…, 3) at rest."""
    return np.clip(TINTS + (points[..., :2] @ GRADIENTS)[..., None], 0, 255).astype(np.float32)


class Scene:
    """Exact images, in two sensors with a lens, of a textured plane that moved with the sheet from z = 1 m."""

    def __init__(self, kind: str, theta: np.ndarray):
        around = pose.from_rotation_vector([0, 0, 0], [0, 0, 1.0])
        motion = around @ pose.from_rotation_vector(theta[:3], theta[3:]) @ pose.inverse(around)
        normal = motion[:3, 2]
        offset = float(normal @ pose.transform(motion, np.array([0, 0, 1.0])))
        self.depth = depth_image(plane_distance(TOF, normal, offset))
        points = PICTURE.unproject(plane_distance(PICTURE, normal, offset))
        self.colors = tints(pose.transform(pose.inverse(motion), points))
        sensors = [Sensor("tof", TOF, DEPTH), Sensor("color", PICTURE, GaussianColor(LEVELS))]
        self.synthesizer = KINDS[kind].build(Rig("r", {sensor.name: sensor for sensor in sensors}), MESH)
        self.surface = Rigid(MESH).deform(theta[None])
        self.predicted = Prediction(self.surface, resampling=self.synthesizer.observe(observation(tof=self.depth)))

    def mosaic(self, pattern: np.ndarray) -> ChannelImage:
        image = ChannelImage(np.empty(self.colors.shape[:2], np.float32), pattern)
        image.values[:] = np.take_along_axis(self.colors, image.channel[..., None].astype(int), axis=2)[..., 0]
        return image

    def looks(self) -> np.ndarray:
        return tints(self.synthesizer.canvas.vertices)

    def channel(self, noise: GaussianGrey | GaussianBayer, pattern: np.ndarray) -> ObservedChannel:
        looks = self.looks()[:, : int(pattern.max()) + 1]
        term = ChannelTerm("color", self.synthesizer, looks, noise, Passive(), BOUNDS)
        return term.observe(self.mosaic(pattern), self.predicted)


def residuals(term: ObservedTerm, scene: Scene) -> np.ndarray:
    """Normalised residuals of all measured samples, none of which is an outlier."""
    found = stack(term.linearize(scene.surface, Rigid(MESH).sparse_jacobian(np.zeros(6))), 6).residual
    assert len(found) % term.fit(scene.surface).samples == 0  # a colour has three
    return found


@ALL
@settings(max_examples=4)
@given(
    st.lists(st.floats(-0.25, 0.25), min_size=3, max_size=3), st.lists(st.floats(-0.02, 0.02), min_size=3, max_size=3)
)
def test_a_plane_is_found_where_it_is(kind, turn, shift):
    """Samples agree with ray casting of the same plane up to the pixel size; the reference shares no code with them.

    A pixel is 3.3 mm wide and four levels of the texture in one channel; half of that is the rounding error.
    """
    scene = Scene(kind, np.array(turn + shift))
    depth = DepthTerm("tof", scene.synthesizer, MESH, DEPTH, BOUNDS)
    depth = depth.observe(scene.depth, scene.predicted)
    residual, fit = residuals(depth, scene), depth.fit(scene.surface)
    assert len(residual) > 0.9 * fit.visible > 100
    steepest = 1.7e-3 * np.sqrt(2) * np.tan(0.25 * np.sqrt(3) + 0.27)  # half a pixel diagonal on an inclined plane
    assert np.abs(residual).max() * DEPTH.sigma < 1.5 * steepest + 1e-5
    color = ColorTerm("color", scene.synthesizer, scene.looks(), GaussianColor(LEVELS), BOUNDS)
    color = color.observe(ColorImage(np.rint(scene.colors).astype(np.uint8)), scene.predicted)
    assert color.fit(scene.surface).samples > 100
    bayer = scene.channel(GaussianBayer(LEVELS), BAYER_ORDERS["gbrg"])
    for term in (color, bayer):
        assert np.abs(residuals(term, scene)).max() * LEVELS < 6


@ALL
@pytest.mark.parametrize("name", ["grey", *BAYER_ORDERS])
def test_the_gradient_of_one_number_per_pixel_is_that_of_the_cost(kind, name):
    scene = Scene(kind, np.zeros(6))
    grey = name == "grey"
    pattern = ONE_CHANNEL if grey else BAYER_ORDERS[name]
    term = scene.channel(GaussianGrey(LEVELS) if grey else GaussianBayer(LEVELS), pattern)
    for parameter in (3, 4):
        theta = 0.01 * np.eye(6)[parameter]  # 1 cm from the truth
        numerical, linear = slope(term, Rigid(MESH), theta, parameter, 0.01)
        assert linear == pytest.approx(numerical, rel=0.1)
        assert abs(linear) > 100


@ALL
def test_a_sheet_is_not_shifted(kind):
    """Rounding to pixels has zero mean: a fraction of a pixel common to all vertices would bias the estimate.

    On average over poses of the sheet, less than a seventh of a pixel remains; a pixel is 1.5 and 1.2 levels.
    """
    generator, means = np.random.default_rng(1), []
    for _ in range(10):
        scene = Scene(kind, np.concatenate([np.zeros(3), generator.uniform(-5e-3, 5e-3, 3)]))
        means.append(residuals(scene.channel(GaussianGrey(1.0), ONE_CHANNEL), scene).mean())
    assert abs(np.mean(means)) < 0.2
