"""Common errors in calibrating, and their diagnoses."""

import re
from dataclasses import replace
from typing import NoReturn

import numpy as np
import pytest

from calib.board.views import CornerView, PlaneView
from calib.camera import Camera
from calib.lenses.lens import Lens
from calib.solve.bundle.adjustment import NotSolvedError
from calib.solve.bundle.observability import UndeterminedError, require_determined
from calib.solve.bundle.tasks import SensorTask, Task, TaskError
from calib.solve.calibrate import calibrate
from calib.solve.diagnoses import MixedUpError, SquareSizeError, ViewsError
from calib.solve.start import extrinsics_graph
from calib.solve.start.extrinsics_graph import ContradictionError, NotConnectedError
from calib.solve.validation.other_lens import other_lenses
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_views import Head

SHOTS = 12


def kept(heads: dict[str, Head]) -> dict[str, SensorTask]:
    """Factory intrinsics of all heads, kept."""
    return {
        name: SensorTask(head.camera.width, head.camera.height, factory=(head.camera,), fixed_intrinsics=True)
        for name, head in heads.items()
    }


def scene(count: int = SHOTS) -> tuple[dict[str, Head], Task]:
    generator = np.random.default_rng(21)
    heads = board_views.three_heads()
    seen = board_views.look(heads, board_views.random_boards(count, generator), generator)
    return heads, Task(kept(heads), seen.corners, seen.planes, "tof")


def of(view: CornerView | PlaneView, *names: str) -> bool:
    return view.sensor in names


@pytest.mark.slow
def test_squares_of_another_size_are_noticed_by_depth_sensors() -> None:
    _, task = scene()
    shrunk = [replace(view, points_b=view.points_b / 0.93) for view in task.corners]  # said to be larger than they are
    with pytest.raises(SquareSizeError, match="ruler") as caught:
        calibrate(replace(task, corners=shrunk))
    assert caught.value.scale == pytest.approx(0.93, abs=0.005)


@pytest.mark.slow
def test_an_offset_of_distances_is_not_taken_for_a_wrong_size() -> None:
    _, task = scene()
    late = [replace(view, distances=view.distances + 0.03) for view in task.planes]
    sensors = {name: replace(each, depth_terms=("depth_offset",)) for name, each in task.sensors.items()}
    sensors["color"] = replace(sensors["color"], depth_terms=())
    solution = calibrate(replace(task, planes=late, sensors=sensors))
    assert solution.state.sensors["tof"].depth_offset == pytest.approx(0.03, abs=0.003)


def test_too_few_views_are_counted() -> None:
    _, task = scene(2)
    with pytest.raises(ViewsError, match=r"tof: 2 views of 2 distinct poses of the board; at least 3"):
        calibrate(task)


def test_sensors_that_share_no_shot_are_named() -> None:
    _, task = scene()
    apart = [view for view in task.corners if of(view, "tof", "light") == (view.shot < SHOTS // 2)]
    planes = [view for view in task.planes if view.shot < SHOTS // 2]
    with pytest.raises(NotConnectedError, match=r"color: no shot shows the board"):
        calibrate(replace(task, corners=apart, planes=planes))


def test_images_of_different_moments_contradict_each_other() -> None:
    _, task = scene()
    shifted = [replace(view, shot=(view.shot + 5) % SHOTS) if of(view, "color") else view for view in task.corners]
    with pytest.raises(ContradictionError, match="not taken at the same moment"):
        calibrate(replace(task, corners=shifted))


def test_names_exchanged_between_cameras_of_one_size_are_noticed() -> None:
    generator = np.random.default_rng(2)
    left = board_views.three_heads()["light"]
    right = replace(left, camera=replace(left.camera, fx=470.0, fy=470.0))
    seen = board_views.look({"left": left, "right": right}, board_views.random_boards(8, generator), generator)
    task = Task(kept({"left": right, "right": left}), seen.corners, (), "left")
    with pytest.raises(MixedUpError, match="left and right are mixed up"):
        calibrate(task)


def test_corners_outside_the_image_tell_whose_they_might_be() -> None:
    _, task = scene()
    renamed = {"tof": "color", "color": "tof", "light": "light"}
    swapped = [replace(view, sensor=renamed[view.sensor]) for view in task.corners]
    with pytest.raises(MixedUpError, match="they would fit"):
        calibrate(replace(task, corners=swapped))


def test_a_corner_beside_the_image_is_named_and_fits_no_other_sensor() -> None:
    """It was said that the largest of all coordinates is outside, and that the views would fit another sensor."""
    _, task = scene()
    view = task.corners[0]
    pixels = view.pixels.copy()
    below = max(sensor.height for sensor in task.sensors.values())
    for beside, named in (((-0.7, 12), r"\[-0\.7, 12\.0\]"), ((12, below), rf"\[12\.0, {below}\.0\]")):
        pixels[3] = beside
        with pytest.raises(MixedUpError, match=rf"{view.sensor}, shot {view.shot}: a corner at {named} .* pixels$"):
            calibrate(replace(task, corners=[replace(view, pixels=pixels), *task.corners[1:]]))


def test_kept_intrinsics_of_another_mode_are_noticed() -> None:
    heads, task = scene()
    wrong = replace(heads["color"].camera, fx=1400.0, fy=1400.0)
    sensors = {**task.sensors, "color": replace(task.sensors["color"], factory=(wrong,))}
    with pytest.raises(MixedUpError, match="color: with the given intrinsics"):
        calibrate(replace(task, sensors=sensors))


def test_what_the_views_leave_open_is_named() -> None:

    curvature = np.diag([1.0, 4.0, 9.0])
    curvature[0, 1] = curvature[1, 0] = 2.0
    with pytest.raises(UndeterminedError, match=r"a\.fx, b\.z") as caught:
        require_determined(curvature, ("a.fx", "b.z", "c.x"))
    assert caught.value.names == ["a.fx", "b.z"]
    with pytest.raises(UndeterminedError, match=r"c\.x"):
        require_determined(np.diag([1.0, 1.0, 0.0]), ("a.fx", "b.z", "c.x"))


def test_a_clock_cannot_be_found_from_boards_that_stand_still() -> None:
    _, task = scene()
    sensors = {**task.sensors, "color": replace(task.sensors["color"], free_running=True)}
    with pytest.raises(UndeterminedError, match=r"color\.time_offset"):
        calibrate(replace(task, sensors=sensors))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"reference": "nobody"}, "must be one of"),
        ({"corners": ()}, "no view shows any corner"),
        ({"sensors": {"tof": SensorTask(320, 240)}}, "no sensors of this calibration"),
    ],
)
def test_a_task_that_makes_no_sense_is_refused(changes: dict[str, object], message: str) -> None:
    _, task = scene(3)
    with pytest.raises(TaskError, match=message):
        replace(task, **changes)  # pyright: ignore[reportArgumentType]


def test_a_sensor_needs_a_calibration_to_keep_and_depth_terms_that_exist() -> None:
    with pytest.raises(TaskError, match="calibration to keep"):
        SensorTask(320, 240, fixed_intrinsics=True)
    with pytest.raises(TaskError, match="depth terms must be of depth_offset, depth_scale, not bend"):
        SensorTask(320, 240, depth_terms=("bend",))


def test_ambiguous_views_agree_on_the_true_pose_between_two_sensors() -> None:
    from calib.solve.start.board_poses import pose_candidates

    heads, task = scene()
    seen = {
        name: {view.shot: pose_candidates(heads[name].camera, view) for view in task.corners if view.sensor == name}
        for name in ("tof", "color")
    }
    flipped = {shot: found[::-1] for shot, found in seen["tof"].items()}
    np.testing.assert_allclose(
        extrinsics_graph.relative_pose({**seen, "tof": flipped}, "tof", "color"), heads["color"].camera.T_rs, atol=0.03
    )


def facing(tilt: float) -> Task:
    """Boards that nearly all face a camera whose lens bends."""
    random = np.random.default_rng(3)
    lens = Lens(np.array([-0.28, 0.09, 0.0006, -0.0004, 0]))
    heads = {"color": Head(Camera(640, 480, 536.0, 537.5, 331.0, 236.0, lens), corner_sigma=0.03)}
    seen = board_views.look(heads, board_views.random_boards(16, random, 0.6, 1.0, tilt=(0.0, tilt)), random)
    return Task({"color": SensorTask(640, 480)}, seen.corners, (), "color")


def test_a_focal_length_is_not_begun_with_many_times_too_short() -> None:
    """There was no minimum, as the start was 160 of 536 px, and a fisheye was advised."""
    solution = calibrate(facing(0.03))
    fx = solution.parameters[0]
    assert (fx.name, fx.value) == ("color.fx", pytest.approx(536, abs=3 * fx.sigma))
    assert fx.sigma > 0.02 * fx.value  # which is not trusted
    assert other_lenses(solution) == []


def no_minimum(*_: object) -> NoReturn:
    raise NotSolvedError("no minimum after 300 steps")


@pytest.mark.parametrize(("tilt", "is_named"), [(0.02, True), (0.6, False)])
def test_boards_that_all_face_the_camera_are_named(
    monkeypatch: pytest.MonkeyPatch, tilt: float, is_named: bool
) -> None:
    """It was said that the views contradict each other, or that the lens does not fit."""
    monkeypatch.setattr("calib.solve.calibrate.adjust", no_minimum)  # found or not by the last digits of a processor
    with pytest.raises(NotSolvedError, match=r"^no minimum after 300 steps") as raised:
        calibrate(facing(tilt))
    found = re.search(r"held alike in all views, .* tilt it by 20° to 40°", str(raised.value))
    assert bool(found) == is_named
