"""Residuals and their derivatives, against OpenCV's projection and finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens
from calib.solve.bundle import rotations
from calib.solve.bundle.equations import Equations
from calib.solve.bundle.formulation import formulate, groups_of
from calib.solve.bundle.parameters.layout import Layout
from calib.solve.bundle.parameters.lens_parameters import BROWN_CONRADY, FISHEYE, RATIONAL, LensKind
from calib.solve.bundle.parameters.state import SensorState, State
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.validation import projection_uncertainty
from evaluation.scenes.boards import board_views

KINDS = {"tof": BROWN_CONRADY, "light": RATIONAL, "color": FISHEYE}


def equations(free_running: str = "none", random: np.random.Generator | None = None) -> Equations:
    """A rig with everything free, at the truth or, with a generator, beside it."""
    generator = np.random.default_rng(3)
    heads = board_views.three_heads()
    heads["color"] = replace(heads["color"], camera=fisheye(heads["color"].camera))
    boards = board_views.random_boards(5, generator)
    times = {shot: 0.1 * shot for shot in boards}
    seen = board_views.look(heads, boards, generator, times)
    sensors = {
        name: SensorTask(
            head.camera.width,
            head.camera.height,
            KINDS[name],
            depth_terms=("depth_offset", "depth_scale") if head.depth_sigma else (),
            free_running=name == free_running,
        )
        for name, head in heads.items()
    }
    task = Task(sensors, seen.corners, seen.planes, "tof")
    states = {name: SensorState(head.camera, 0.01, -0.02, 0.013) for name, head in heads.items()}
    return formulate(task)(State(states, boards), (1.0,) * len(groups_of(task)))


def fisheye(camera: Camera) -> Camera:
    return replace(camera, lens=KannalaBrandt(np.array([0.02, -0.01, 0.003, -0.001])))


@pytest.mark.parametrize("free_running", ["none", "light", "color"])
def test_the_sparse_jacobian_is_that_of_finite_differences(free_running: str) -> None:
    system = equations(free_running)
    layout = system.layout
    here = np.random.default_rng(7).normal(0, 1e-3, layout.size)
    jacobian = system.jacobian(here).toarray()
    for column, name in enumerate(layout.names):
        step = np.zeros(layout.size)
        step[column] = 1e-6
        differences = (system.residuals(here + step) - system.residuals(here - step)) / 2e-6
        assert np.abs(differences - jacobian[:, column]).max() <= 1e-5 * np.abs(jacobian[:, column]).max(), name


def test_a_row_depends_on_its_sensor_and_its_board_only() -> None:
    system = equations()
    jacobian = system.jacobian(np.zeros(system.layout.size))
    assert np.diff(jacobian.indptr).max() <= 12 + 6 + 2 + 6
    held = 3 + 4  # the denominator of the rational lens, and the depth terms of two sensors
    assert jacobian.shape == (system.ends[-1] + held, system.layout.size)


def test_residuals_of_true_states_are_noise() -> None:
    generator = np.random.default_rng(5)
    heads, boards = board_views.three_heads(), board_views.random_boards(8, generator)
    seen = board_views.look(heads, boards, generator)
    task = Task(
        {name: SensorTask(head.camera.width, head.camera.height) for name, head in heads.items()},
        seen.corners, seen.planes, "tof",
    )  # fmt: skip
    state = State({name: SensorState(head.camera) for name, head in heads.items()}, boards)
    system = formulate(task)(state, (1.0,) * len(groups_of(task)))
    residuals = system.residuals(np.zeros(system.layout.size))
    for group, rows in zip(system.groups, system.slices(), strict=True):
        assert np.std(residuals[rows]) == pytest.approx(1, abs=0.1), group.name
        assert np.abs(np.mean(residuals[rows])) < 0.15, group.name


def test_increments_that_describe_no_camera_are_rejected_by_residuals_that_are_not_finite() -> None:
    system = equations()
    step = np.zeros(system.layout.size)
    step[system.layout.columns("tof", ["fx"])] = -1000
    assert not np.any(np.isfinite(system.residuals(step)))


def test_the_left_jacobian_composes_rotations() -> None:
    generator = np.random.default_rng(2)
    vectors = np.concatenate([generator.normal(0, 1, (20, 3)), generator.normal(0, 1e-5, (5, 3)), np.zeros((1, 3))])
    steps = generator.normal(0, 1e-6, vectors.shape)
    turned = np.einsum("nij,nj->ni", rotations.left_jacobian(vectors), steps)
    expected = rotations.exponential(turned) @ rotations.exponential(vectors)
    np.testing.assert_allclose(rotations.exponential(vectors + steps), expected, atol=1e-10)


@pytest.mark.parametrize("kind", [BROWN_CONRADY, FISHEYE])
def test_derivatives_from_image_to_image_are_those_of_finite_differences(kind: LensKind) -> None:
    system = equations()
    layout, state = system.layout, system.base
    source, target = ("tof", "light") if kind is BROWN_CONRADY else ("tof", "color")
    changes = projection_uncertainty.pair_jacobian(state, layout, source, target, 1.1)
    pixels = projection_uncertainty.grid(state.sensors[source].camera).reshape(-1, 2)
    for index, column in enumerate(projection_uncertainty.pair_columns(layout, source, target)):
        step = np.zeros(layout.size)
        step[column] = 1e-6
        ends = [
            projection_uncertainty.map_pixels(layout.move(state, sign * step), source, target, pixels, 1.1)
            for sign in (1, -1)
        ]
        seen = np.isfinite(ends[0]).all(axis=1) & np.isfinite(ends[1]).all(axis=1)
        differences = (ends[0] - ends[1])[seen] / 2e-6
        scale = max(1.0, float(np.abs(differences).max()))
        np.testing.assert_allclose(changes[seen][:, :, index], differences, atol=1e-4 * scale)


def test_a_turn_of_the_camera_is_no_change_of_a_projection() -> None:
    camera = board_views.three_heads()["color"].camera
    points = np.random.default_rng(1).uniform((-0.4, -0.3, 0.8), (0.4, 0.3, 1.5), (50, 3))
    turn = pose.from_rotation_vector((1e-5, -2e-5, 3e-5), (1e-5, 2e-5, -1e-5))
    alone = replace(camera, T_rs=np.eye(4), lens=Lens())
    change = (alone.project(pose.transform(turn, points)) - alone.project(points))[:, :, None]
    undone = projection_uncertainty.MotionCompensation(alone, points).at(points, change, change)
    assert np.abs(undone).max() < 1e-3 * np.abs(change).max()


def test_the_layout_names_every_column_once() -> None:
    layout: Layout = equations().layout
    assert len(layout.names) == len(set(layout.names)) == layout.size
    assert layout.names[layout.columns("light", ["k6"])[0]] == "light.k6"
