"""Single intrinsics that stay as they begin, and focal lengths that are tied."""

from dataclasses import replace

import numpy as np
import pytest

from calib.solve.bundle.formulation import formulate
from calib.solve.bundle.parameters.lens_parameters import BROWN_CONRADY, RATIONAL
from calib.solve.bundle.tasks import SensorTask, Task, TaskError
from calib.solve.calibrate import calibrate
from calib.solve.start.start import start
from calib.solve.validation import projection_uncertainty
from evaluation.scenes.boards import board_views

HEAD = board_views.three_heads()["color"]


def task(*fixed: str) -> Task:
    random = np.random.default_rng(3)
    seen = board_views.look({"color": HEAD}, board_views.random_boards(12, random), random)
    sensor = SensorTask(HEAD.camera.width, HEAD.camera.height, BROWN_CONRADY, (HEAD.camera,), fixed=fixed)
    return Task({"color": sensor}, seen.corners, (), "color")


def test_what_is_fixed_stays_and_has_no_deviation() -> None:
    solution = calibrate(task("k3", "cx"))
    camera = solution.cameras["color"]
    assert camera.lens.coefficients[4] == HEAD.camera.lens.coefficients[4]
    assert camera.cx == HEAD.camera.cx
    assert camera.cy != HEAD.camera.cy
    names = [each.name for each in solution.parameters]
    assert not {"color.k3", "color.cx"} & {*names}
    assert "color.k2" in names


def test_a_fixed_aspect_ties_the_focal_lengths() -> None:
    solution = calibrate(task("aspect"))
    camera = solution.cameras["color"]
    assert camera.fx != HEAD.camera.fx
    assert camera.fy / camera.fx == pytest.approx(HEAD.camera.fy / HEAD.camera.fx, rel=1e-12)
    free = calibrate(task())
    sigmas = [next(each.sigma for each in found.parameters if each.name == "color.fx") for found in (solution, free)]
    assert sigmas[0] < 1.2 * sigmas[1]
    assert projection_uncertainty.image_uncertainty(solution, "color", 1.0).rms < 0.5


def test_derivatives_of_tied_focal_lengths_are_those_of_the_residuals() -> None:
    usable, state = start(task("aspect"), lambda _: None)
    equations = formulate(usable)(state, (1.0,))
    names = equations.layout.names
    assert "color.fy" not in names
    step = np.zeros(len(names))
    step[names.index("color.fx")] = 1e-3
    slope = (equations.residuals(step) - equations.residuals(-step)) / 2e-3
    jacobian = equations.jacobian(np.zeros(len(names))).toarray()[:, names.index("color.fx")]
    np.testing.assert_allclose(jacobian, slope, rtol=1e-4, atol=1e-4)


def test_one_fixed_focal_length_and_their_ratio_fix_both() -> None:
    sensor = replace(task().sensors["color"], fixed=("fy", "aspect"))
    assert not {"fx", "fy"} & {*sensor.free_parameters(False).intrinsics}


def test_a_parameter_that_a_lens_lacks_cannot_be_fixed() -> None:
    with pytest.raises(TaskError, match="k5: can be fixed: fx, fy"):
        SensorTask(320, 240, BROWN_CONRADY, fixed=("k5",))
    assert SensorTask(320, 240, RATIONAL, fixed=("k5",)).fixed == ("k5",)
