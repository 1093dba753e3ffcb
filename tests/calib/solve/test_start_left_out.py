"""Views that a calibration does not use are counted and said."""

from dataclasses import replace

import numpy as np

from calib.solve.bundle.parameters.lens_parameters import KINDS
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.start import start as module
from evaluation.scenes.boards.board_views import look, random_boards, three_heads


def test_views_without_a_pose_of_the_board_are_counted(monkeypatch) -> None:
    heads, random = {"tof": three_heads()["tof"]}, np.random.default_rng(1)
    seen = look(heads, random_boards(8, random), random)
    camera, possible = replace(heads["tof"].camera, T_rs=np.eye(4)), module.pose_candidates
    monkeypatch.setattr(module, "pose_candidates", lambda c, view: [] if view.shot in {2, 5} else possible(c, view))
    sensor = SensorTask(camera.width, camera.height, KINDS["brown-conrady"], (camera,), fixed_intrinsics=True)
    said: list[str] = []
    usable, _ = module.start(Task({"tof": sensor}, seen.corners, seen.planes, "tof"), said.append)
    assert {view.shot for view in usable.corners} == {0, 1, 3, 4, 6, 7}
    assert [text for text in said if "left out" in text] == [
        "tof: 2 of 8 images show a board where its camera could not have seen one; left out: 2, 5",
        "tof: 2 of 8 shots have distances, but no sensor's corners tell where the board is; left out: 2, 5",
    ]


def test_what_a_wide_fisheye_sees_beyond_its_model_is_said() -> None:
    heads, random = {"tof": three_heads()["tof"]}, np.random.default_rng(1)
    seen = look(heads, random_boards(3, random), random)
    whole = Task({"tof": SensorTask(320, 240, KINDS["fisheye"])}, seen.corners, (), "tof")
    assert module.left_out(whole, whole.of_shots([0, 1])) == [
        "tof: 1 of 3 images show a board where its camera could not have seen one, or beyond 90° from its axis, where "
        "a fisheye ends here; left out: 2"
    ]
