"""Boards whose print is not as described, from solves that estimate each camera anew."""

import numpy as np

from calib.calibration_check.stored_calibration import Stored, Views
from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.bundle.observability import UndeterminedError
from calib.solve.bundle.parameters.lens_parameters import kind_of
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.calibrate import calibrate
from calib.solve.diagnoses import ViewsError
from calib.solve.validation.board_shape import ShapeError, shape_errors


def misprint(stored: Stored, views: Views, needed_px: float) -> ShapeError | None:
    """The surest error of the print that a sensor's own corners show; None without any.

    With stored intrinsics, another ratio of the focal lengths would look the same.

    Args:
        stored: the calibration, whose cameras are initial estimates.
        views: new views.
        needed_px: required accuracy of projections [px].
    """
    found: list[ShapeError] = []
    for name in dict.fromkeys(view.sensor for view in views.corners):
        camera = stored.sensors[name].camera
        sensor = SensorTask(camera.width, camera.height, kind_of(camera.lens), (camera,))
        try:
            own = [view for view in views.corners if view.sensor == name]
            solution = calibrate(Task({name: sensor}, own, (), name))
        except (ViewsError, NotSolvedError, UndeterminedError):
            continue
        distances = [np.linalg.norm((camera.T_sr @ T_rb)[:3, 3]) for T_rb in solution.state.boards.values()]
        found += [one for one in shape_errors(solution, float(np.median(distances)), needed_px) if one.is_misprint]
    return max(found, key=lambda one: abs(one.size) / one.sigma, default=None)
