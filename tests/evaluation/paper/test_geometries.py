"""E1 on little: the camera's calibration, the bound against draws of its own, and the quick experiment."""

import dataclasses
import json

import numpy as np
import pytest

from abs_service.tracker.detection.initial_detection import InitialDetection
from calib.noise.base import pixels_where
from evaluation.experiment import Context
from evaluation.paper import geometries
from evaluation.paper.geometries import assumptions, bound, measuring, sensor
from evaluation.paper.geometries.bound import Priors
from evaluation.paper.geometries.known_sheet import KnownSheet
from evaluation.scenes.geometries import GEOMETRIES, Motion, MovingSheet
from evaluation.scenes.printed_sheet import PrintedSheet, random_print
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import SplineSurface, Wall
from evaluation.scenes.time_of_flight import SR4000

MOTION = Motion()
KNOWN = KnownSheet(MOTION.width, MOTION.distance)


def sheet(name: str) -> MovingSheet:
    return MovingSheet(GEOMETRIES[name], MOTION, np.array([0.1, 0.2, 0.3]))


@pytest.mark.parametrize("name", GEOMETRIES)
def test_every_geometry_begins_flat_moves_smoothly_and_hardly_stretches(name: str) -> None:
    moving = sheet(name)
    np.testing.assert_allclose(moving.control(0), KNOWN.control, atol=1e-9)
    controls = np.stack([moving.control(k / 30) for k in range(120)])
    speed = np.linalg.norm(np.diff(controls, axis=0), axis=-1) * 30
    assert speed.max() < 0.6
    stretch = [bound.edges(control, KNOWN, 1.0)[1] for control in controls[::10]]
    assert np.sqrt(np.mean(np.square(stretch))) < 0.01


def test_geometries_differ() -> None:
    bent = [sheet(name).control(1.0) for name in GEOMETRIES]
    apart = [np.abs(a - b).max() for i, a in enumerate(bent) for b in bent[:i]]
    assert min(apart) > 0.003


def test_the_known_sheet_has_the_true_control_points() -> None:
    nothing = InitialDetection(np.zeros((0, 0), np.float32), SR4000, 0)
    model = KNOWN.build(nothing)
    assert model.rest == pytest.approx(KNOWN.control.ravel())
    control = sheet("corner").control(0.9)
    u, w = KNOWN.places
    true = SplineSurface((4, 4), 2, u, w).points(control).reshape(-1, 3)
    found = model.deform(control.reshape(1, -1)).vertices[0].T
    assert np.abs(np.sort(found, axis=0) - np.sort(true, axis=0)).max() < 1e-6
    assert np.all(model.mesh.normals[:, 2] < 0)


@pytest.mark.slow
def test_calibration_finds_how_every_pixel_errs() -> None:
    generator = np.random.default_rng(0)
    camera = sensor.true_sensor(generator)
    models = sensor.calibrated(camera, 8, generator)
    model = models[sensor.PLAIN]
    view = Renderer(SR4000, Wall(1.0, 0.3)).render()
    amplitude = camera.amplitude(view)
    everywhere = np.ones(view.distance.shape, bool)
    found = model.deviation(view.distance.ravel(), amplitude.ravel(), pixels_where(everywhere))
    error = found.reshape(view.distance.shape) / camera.deviation(view.distance, amplitude) - 1
    # From 15 × 8 measurements, a deviation is known to 1 / √240; pixels alone would scatter by 30 %.
    assert np.sqrt(np.mean(error**2)) < 0.09
    assert abs(error.mean()) < 0.03
    offsets = {name: np.abs(one.offset).max() for name, one in models.items()}
    assert offsets[sensor.PLAIN] == offsets[sensor.POLYNOMIAL] == 0
    assert offsets[sensor.OFFSETS] > 1e-4
    assert offsets[sensor.BOTH] > 1e-4


def test_the_bound_is_the_scatter_of_weighted_least_squares() -> None:
    """A linear problem, solved with draws of the noise: its errors are the bound's, with weights and without."""
    generator = np.random.default_rng(1)
    scene = PrintedSheet(sheet("cylinder"), sensor.true_sensor(generator), random_print(generator))
    control = scene.control(10)
    images = bound.derivatives(scene, control)
    mean = float(images.deviation.mean())
    firm = Priors(0.02, 0.3)
    everywhere = dataclasses.replace(KNOWN, vertices=40_000, inset=0.0)
    found = bound.bound(control, everywhere, firm, images, mean)
    assert found.pixels == images.inner.sum()
    assert found.posterior == pytest.approx(found.full)
    assert found.sensors[0] > found.posterior[0]
    assert found.euclidean[0] > found.posterior[0]
    loose = bound.bound(control, everywhere, Priors(1e6, 1e6), images, mean)
    assert loose.posterior == pytest.approx(loose.sensors, rel=1e-3)
    assert loose.sensors[0] == pytest.approx(scatter_mm(images, images.deviation, generator), rel=0.1)
    assert loose.euclidean[0] == pytest.approx(
        scatter_mm(images, np.full_like(images.deviation, mean), generator), rel=0.1
    )


def scatter_mm(images: bound.Derivatives, weights: np.ndarray, generator: np.random.Generator) -> float:
    rows = np.concatenate([images.distance / weights[:, None], images.grey / measuring.GREY_DEVIATION])
    noise = np.concatenate(
        [generator.standard_normal((len(weights), 300)) * (images.deviation / weights)[:, None],
         generator.standard_normal((len(weights), 300))]
    )  # fmt: skip
    errors = np.linalg.lstsq(rows, noise, rcond=None)[0]
    return float(np.sqrt(3 * np.mean(errors**2)) * 1e3)


def test_a_vertex_reads_the_pixel_that_it_falls_on() -> None:
    generator = np.random.default_rng(2)
    scene = PrintedSheet(sheet("plane"), sensor.true_sensor(generator), random_print(generator))
    control = scene.control(0)
    images = bound.derivatives(scene, control)
    few = bound.bound(control, dataclasses.replace(KNOWN, vertices=100), Priors(0.02, 0.3), images, 0.004)
    assert 90 <= few.pixels <= 110


@pytest.mark.slow
def test_the_likelihood_comes_near_the_bound_and_profits_from_the_noise_model() -> None:
    """Less than the quick experiment: one geometry, few frames."""
    little = dataclasses.replace(
        geometries.QUICK, geometries=1, frames=12, prior_frames=3, undone_frames=4, mesh_frames=3, calibration_frames=4
    )
    findings = geometries.run(little, Context(seed=0))
    assert findings.values["tracked"] == [1.0]
    assert findings.values["ratio_mean"] > 1.3
    assert max(findings.values["to_bound"]) < 1.5
    assert set(findings.values["ratio_undone"]) == {one.name for one in assumptions.CONDITIONS}
    json.dumps(findings.values)
    assert [section.title for section in findings.sections] == [
        "Geometries",
        "What makes it easier, undone",
        "The bound",
        "What each prior contributes",
        "Other meshes, the outline, and the paper's search",
        "Pictures",
    ]
