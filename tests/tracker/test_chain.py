"""In one loop from Θ to cost, or by each part for the whole population: the costs are the same."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from abs_service.pairing.image_decoders import BAYER_ORDERS
from abs_service.pairing.images import ChannelImage, ColorImage, Image
from abs_service.pairing.observation import Observation
from abs_service.tracker import fused_cost
from abs_service.tracker.detection.sheet_mesh import Sheet
from abs_service.tracker.models import flexpad, nurbs, posed, rigid
from abs_service.tracker.models.base import DeformationModel
from abs_service.tracker.objectives import likelihood
from abs_service.tracker.posterior.posterior import Posterior
from abs_service.tracker.posterior.priors import MotionPrior, Settings, ShapePrior
from abs_service.tracker.posterior.stretch_prior import StretchPrior
from abs_service.tracker.synthesis import dense, sparse
from calib import pose
from calib.camera import Camera
from calib.noise.bayer import GaussianBayer
from calib.noise.color import GaussianColor
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.intensity import GaussianIntensity
from calib.rig import Noise, Rig, Sensor
from tests.tracker.scenes import CAMERA, FISHEYE, depth_image, flat, observation, plane_distance, sheet

PINHOLE = Camera(200, 120, 220.0, 220.0, 99.5, 59.5)
NOISES: dict[str, Noise] = {
    "tof": GaussianPolynomial(((3e-3,),)),
    "color": GaussianColor(),
    "mosaic": GaussianBayer(20.0),
    "infrared": GaussianIntensity("ir", 10.0),
}
FLEXPAD = flexpad.FlexPad(Sheet(pose.from_rotation_vector([0.0, 0.1, 0.0], [0.0, 0.0, 1.0]), 0.3, 0.2), 120, 0.1, 1.0)
PLANE = sheet(height=flat)
LIKELIHOOD, SPARSE = likelihood.Settings(), sparse.Settings()
seeds = st.integers(0, 2**32 - 1)


def seen_by(cameras: dict[str, Camera], generator: np.random.Generator, t_ns: int = 0) -> Observation:
    """A wall with a finger before it and a hole in it, and noise in all pictures."""
    made: dict[str, Image] = {}
    for name, camera in cameras.items():
        shape = camera.height, camera.width
        if name == "tof":
            distance = plane_distance(camera, np.array([0.0, 0.0, 1.0]), 1.0)
            distance[30:40, 60:66], distance[50:58, 80:90] = 0.8, np.nan
            made[name] = depth_image(distance)
        elif name == "color":
            made[name] = ColorImage(generator.integers(0, 255, (*shape, 3)).astype(np.uint8))
        else:
            pattern = BAYER_ORDERS["rggb"] if name == "mosaic" else np.zeros((1, 1), np.uint8)
            made[name] = ChannelImage(generator.uniform(0, 255, shape).astype(np.float32), pattern)
    return observation(t_ns, (), **made)


def posterior(
    model: DeformationModel,
    cameras: dict[str, Camera],
    of: likelihood.Settings = LIKELIHOOD,
    synthesis: sparse.Settings | dense.Settings = SPARSE,
) -> Posterior:
    rig = Rig("r", {name: Sensor(name, camera, NOISES[name]) for name, camera in cameras.items()})
    mesh = model.mesh
    objective = of.build(rig, mesh, synthesis.build(rig, mesh))
    priors = StretchPrior(mesh, 0.02), ShapePrior(model.rest, model.prior)
    return Posterior(model, objective, *priors, MotionPrior(model.rest, model.scales, Settings()))


def candidates(model: DeformationModel, generator: np.random.Generator, count: int = 9) -> np.ndarray:
    return model.rest + 0.01 * generator.normal(size=(count, len(model.rest))) * model.scales


def agree(posterior: Posterior, thetas: np.ndarray) -> None:
    """Not to the last digit: the compiler may order sums otherwise where it knows more of what is around them."""
    assert posterior.judge is not None
    np.testing.assert_allclose(posterior.cost(thetas), posterior.cost_in_stages(thetas), rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("names", [(name,) for name in NOISES] + [("tof", "color"), tuple(NOISES)])
def test_one_loop_says_what_the_parts_say_for_any_sensors(names: tuple[str, ...]) -> None:
    generator = np.random.default_rng(1)
    cameras = dict(zip(names, itertools.cycle([PINHOLE, CAMERA, FISHEYE])))
    tracked = posterior(FLEXPAD, cameras)
    for seq in range(2):
        tracked.observe(seen_by(cameras, generator, seq * 33_000_000))
        agree(tracked, candidates(FLEXPAD, generator))


@pytest.mark.parametrize(
    "model",
    [
        nurbs.Settings(control_points=(4, 4)).of_mesh(PLANE),
        nurbs.Settings(control_points=(5, 4), degree=3).of_mesh(PLANE),
        FLEXPAD,
        flexpad.FlexPad(Sheet(pose.from_rotation_vector([0.0, 0.0, 0.0], [0.0, 0.0, 1.0]), 0.9, 0.6), 120, 0.1, 1.0),
    ],
    ids=["4x4", "5x4, cubic", "FlexPad", "large FlexPad"],
)
@settings(max_examples=10)
@given(seeds, st.floats(0, 1), st.sampled_from([PINHOLE, CAMERA, FISHEYE]))
def test_one_loop_says_what_the_parts_say_for_any_model(model, seed, outline, camera) -> None:
    generator = np.random.default_rng(seed)
    tracked = posterior(model, {"tof": camera}, likelihood.Settings(outline_px=0.5 if outline > 0.5 else 0.0))
    tracked.observe(seen_by({"tof": camera}, generator))
    agree(tracked, candidates(model, generator))


def test_a_sensor_that_is_missing_costs_nothing_and_comes_back() -> None:
    generator, cameras = np.random.default_rng(2), {"tof": PINHOLE, "color": CAMERA}
    tracked = posterior(FLEXPAD, cameras)
    for seq, names in enumerate([("tof", "color"), ("tof",), ("color",), ("tof", "color")]):
        tracked.observe(seen_by({name: cameras[name] for name in names}, generator, seq * 33_000_000))
        agree(tracked, candidates(FLEXPAD, generator))


def test_parts_that_are_no_steps_are_asked_for_the_whole_population() -> None:
    generator, cameras = np.random.default_rng(3), {"tof": PINHOLE}
    still = posed.Posed(FLEXPAD)
    cases = [
        posterior(still, cameras),
        posterior(rigid.Rigid(PLANE), cameras),
        posterior(FLEXPAD, cameras, synthesis=dense.Settings()),
    ]
    for tracked, model in zip(cases, (still, rigid.Rigid(PLANE), FLEXPAD)):
        tracked.observe(seen_by(cameras, generator))
        assert tracked.judge is None
        thetas = candidates(model, generator)
        np.testing.assert_array_equal(tracked.cost(thetas), tracked.cost_in_stages(thetas))


def test_what_has_nothing_to_say_costs_nothing() -> None:
    one = fused_cost.Step(fused_cost.cost)
    assert fused_cost.both(one, fused_cost.NOTHING) is one
    silent = fused_cost.available([(True, one), (False, one)])
    empty = fused_cost.Chain(
        fused_cost.Step(fused_cost.deform, (0,)), fused_cost.NOTHING, fused_cost.NOTHING, fused_cost.NOTHING, silent
    )
    np.testing.assert_array_equal(empty.cost(np.ones((3, 2))), np.zeros(3))


def test_what_cannot_tell_of_itself_is_no_step() -> None:
    assert fused_cost.step_of(PLANE) is None
