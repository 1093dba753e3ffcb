"""What an estimate costs: kernels per vertex and candidate beside a C++ yardstick, set-up and whole frames.

Compare minima of one run with each other; machines, and hours on one machine, differ. The yardstick is a fused,
hand-vectorised kernel for degree 2 and one knot span (deform, project, compare), kept outside the repository.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from abs_service.observation import Observation, Observer
from abs_service.tracker.curvature import gauss_newton, search_metric
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.nurbs import Nurbs, Settings
from abs_service.tracker.objectives.likelihood import Settings as Likelihood
from abs_service.tracker.priors import StretchPrior
from abs_service.tracker.synthesis.sparse import Sparse, SparseView
from abs_service.tracker.terms.linearization import Linearization
from abs_service.tracking import Tracking
from calib.noise.base import render_texture
from calib.rig import Rig
from tests.tracker.differences import central_differences
from tests.tracker.driving import default_plan, frame_set, rig_of, simulate
from tests.tracker.scenes import sheet

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


def per_vertex(benchmark, population: int = POPULATION, vertices: int = VERTICES) -> None:
    """Adds the number to compare; there is none where benchmarks are only run as tests."""
    if benchmark.stats is not None:
        benchmark.extra_info["ns_per_vertex_and_candidate"] = benchmark.stats.stats.min / population / vertices * 1e9


def single_term(sensor: str, mesh: Mesh):
    rig = Rig("r", {sensor: RIG.sensors[sensor]})
    return Likelihood().build(rig, mesh, Sparse(rig, mesh))


def test_yardstick(benchmark):
    beside = Path(__file__).parents[3] / "shared" / "bench"
    folder = Path(os.environ.get("ABS_SHARED_BENCH", beside))
    if not (folder / "run_yardstick.py").is_file():
        pytest.skip(f"no yardstick in {folder}; name its folder with ABS_SHARED_BENCH")
    repeats = 1 if benchmark.disabled else 300
    # In a process of its own: a library built with -ffast-math changes how its process rounds, for every test after it.
    measure = f"import run_yardstick; print(run_yardstick.yardstick_ns({VERTICES}, {POPULATION}, repeats={repeats}))"
    command = [sys.executable, "-c", measure]
    printed = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
    benchmark.extra_info["ns_per_vertex_and_candidate"] = float(printed)
    assert float(printed) > 0
    benchmark.pedantic(lambda: None, rounds=1)


@pytest.mark.parametrize("shape", [(3, 3), (4, 4), (6, 6), (12, 12)], ids=lambda shape: f"{shape[0]}x{shape[1]}")
def test_deform(benchmark, shape):
    model, thetas = model_and_thetas(shape)
    assert benchmark(model.deform, thetas).vertices.shape == (POPULATION, 3, VERTICES)
    per_vertex(benchmark)


def test_synthesize(benchmark):
    model, thetas = model_and_thetas((4, 4))
    surface = model.deform(thetas)
    synthesis = SparseView(RIG.sensors["tof"].camera, model.mesh.faces, model.mesh.colors)
    assert (benchmark(synthesis.synthesize, surface).pixel > 0).all()
    per_vertex(benchmark)


@pytest.mark.parametrize("sensor", ["tof", "color"])
def test_term_with_its_synthesis(benchmark, observation, sensor):
    model, thetas = model_and_thetas((4, 4))
    objective = single_term(sensor, model.mesh)
    objective.observe(observation, model.deform(model.rest[None]))
    surface = model.deform(thetas)
    assert np.isfinite(benchmark(objective.cost, surface)).all()
    per_vertex(benchmark)


@pytest.mark.parametrize("shape", [(3, 3), (4, 4)], ids=lambda shape: f"{shape[0]}x{shape[1]}")
def test_what_the_yardstick_does(benchmark, observation, shape):
    """Deform, synthesise, depth term."""
    model, thetas = model_and_thetas(shape)
    objective = single_term("tof", model.mesh)
    objective.observe(observation, model.deform(model.rest[None]))
    assert np.isfinite(benchmark(lambda: objective.cost(model.deform(thetas)))).all()
    per_vertex(benchmark)


def test_stretch_prior(benchmark):
    model, thetas = model_and_thetas((4, 4))
    prior, surface = StretchPrior(model.mesh, 0.02), model.deform(thetas)
    assert np.isfinite(benchmark(prior.cost, surface)).all()
    per_vertex(benchmark)


def test_per_frame_render_texture(benchmark, observation):
    tof, image = RIG.sensors["tof"], observation.images["tof"]
    assert benchmark(render_texture, tof.noise, image.distance, image.amplitude, 1.6).shape == (146, 178, 8)


def test_per_frame_linearize(benchmark, observation):
    model, thetas = model_and_thetas((4, 4), sheet(17, 18))
    objective = Likelihood().build(RIG, model.mesh, Sparse(RIG, model.mesh))
    objective.observe(observation, model.deform(model.rest[None]))
    surface, moves = model.deform(thetas[:1]), model.moves(thetas[0])
    assert benchmark(objective.linearize, surface, moves)[0].moves.dimension == 48


@pytest.mark.parametrize("size", [(17, 18), (32, 32)], ids=["306", "1024"])
@pytest.mark.parametrize("derivatives", [Nurbs.jacobian, central_differences], ids=["closed", "differences"])
def test_per_frame_jacobian(benchmark, derivatives, size):
    model, thetas = model_and_thetas((4, 4), sheet(*size))
    assert benchmark(derivatives, model, thetas[0]).shape == (size[0] * size[1], 3, 48)


def test_per_frame_search_metric(benchmark):
    jacobian = np.random.default_rng(1).normal(size=(2000, 48))
    quadratic = gauss_newton([Linearization(np.zeros(2000), jacobian)], 48)
    assert benchmark(search_metric, quadratic).shape == (48, 48)


@pytest.mark.parametrize("vertices", [300, 1000])
def test_whole_frame(benchmark, vertices):
    """From a frame set to an estimate with the default plan: 4 × 4 control points, `hybrid`."""
    tracking = Tracking(RIG, default_plan(vertices=vertices))
    exposures = [frame_set(SIMULATION.expose(k)[0], k) for k in range(30, 50)]
    tracking.track(exposures[0], lambda: True)
    following = iter(exposures[1:])
    benchmark.pedantic(
        lambda: tracking.track(next(following), lambda: True), rounds=1 if benchmark.disabled else len(exposures) - 1
    )
