"""Time of an estimate: priors, set-up and whole frames; kernels have their own table (`kernels`).

Compare minima of one run with each other; machines, and hours on one machine, differ.
"""

import numpy as np
import pytest

from abs_service.pairing.observation import Observation
from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.nurbs import Settings
from abs_service.tracker.objectives.likelihood import Settings as Likelihood
from abs_service.tracker.posterior.curvature import gauss_newton, search_metric
from abs_service.tracker.posterior.priors.stretch_prior import StretchPrior
from abs_service.tracker.synthesis.sparse import Sparse
from abs_service.tracker.terms.linearization import Linearization
from abs_service.tracking.observer import Observer
from abs_service.tracking.session import TrackingSession
from evaluation.method.rates.measuring import APPROACH, FIRST
from tests.abs_service.tracker.models.differences import central_differences
from tests.abs_service.tracker.scenes import sheet
from tests.abs_service.tracking.driving import default_plan, frame_set, rig_of, simulate
from tests.calib.noise.texels import render_texture

POPULATION, VERTICES = 32, 1024
SIMULATION = simulate("simulated://sheet?seed=1")
RIG = rig_of(SIMULATION)
MESH = sheet(32, 32)


@pytest.fixture(scope="module")
def observation() -> Observation:
    return Observer(RIG).observe(frame_set(SIMULATION.expose(0)[0], 0))


def model_and_thetas(shape: tuple[int, int], mesh: Mesh = MESH):
    model = Settings(control_points=shape, degree=2).of_mesh(mesh)
    return model, model.rest + np.random.default_rng(1).normal(0, 2e-3, (POPULATION, len(model.rest)))


def test_stretch_prior_32_candidates(benchmark):
    model, thetas = model_and_thetas((4, 4))
    prior, surface = StretchPrior(model.mesh, 0.02), model.deform(thetas)
    assert np.isfinite(benchmark(prior.cost, surface)).all()


def test_per_frame_render_texture(benchmark, observation):
    tof, image = RIG.sensors["tof"], observation.images["tof"]
    assert benchmark(render_texture, tof.noise, image.distance, image.amplitude, 1.6).shape == (146, 178, 8)


def test_per_frame_linearize(benchmark, observation):
    model, thetas = model_and_thetas((4, 4), sheet(17, 18))
    objective = Likelihood().build(RIG, model.mesh, Sparse(RIG, model.mesh))
    observed = objective.observe(observation, model.deform(model.rest[None]))
    surface, sparse_jacobian = model.deform(thetas[:1]), model.sparse_jacobian(thetas[0])
    linearizations = benchmark(observed.linearize, surface, sparse_jacobian)
    assert [linear.jacobian.shape for linear in linearizations] == [(len(one.residual), 48) for one in linearizations]
    assert len(linearizations) >= len(RIG.sensors)  # that of a depth sensor has several parts


def closed(model, theta):
    return model.sparse_jacobian(theta).dense


@pytest.mark.parametrize("size", [(17, 18), (32, 32)], ids=["306", "1024"])
@pytest.mark.parametrize("derivatives", [closed, central_differences])
def test_per_frame_jacobian(benchmark, derivatives, size):
    model, thetas = model_and_thetas((4, 4), sheet(*size))
    assert benchmark(derivatives, model, thetas[0]).shape == (size[0] * size[1], 3, 48)


def test_per_frame_search_metric(benchmark):
    jacobian = np.random.default_rng(1).normal(size=(2000, 48))
    quadratic = gauss_newton([Linearization(np.zeros(2000), jacobian)], 48)
    assert benchmark(search_metric, quadratic).shape == (48, 48)


@pytest.mark.parametrize("vertices", [300, 1000])
def test_whole_frame(benchmark, vertices):
    """Time from a frame set to an estimate with the default plan, `hybrid`, while the sheet moves and bends."""
    session = TrackingSession(RIG, default_plan(vertices=vertices))
    for k in APPROACH:
        session.track(frame_set(SIMULATION.expose(k)[0], k), lambda: True)
    exposures = [frame_set(SIMULATION.expose(k)[0], k) for k in range(FIRST, FIRST + 20)]
    following = iter(exposures)
    estimate = benchmark.pedantic(
        lambda: session.track(next(following), lambda: True), rounds=1 if benchmark.disabled else len(exposures)
    )
    assert estimate.status == Status.TRACKING
