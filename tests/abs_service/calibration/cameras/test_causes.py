"""Causes named by `calibrate verify`: distances instead of a motion, and causes that these shots cannot separate."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from abs_service.calibration.cameras import causes, verification
from abs_service.calibration.files import rig_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.content import Level, Report
from abs_service.report.provenance import Provenance
from calib import pose
from calib.board.views import PlaneView
from calib.calibration_check.comparison import Comparison, Explanation
from calib.calibration_check.hypotheses import Hypothesis, Kind
from calib.pose import Pose
from evaluation.scenes.boards.board_views import Head, look, random_boards, three_heads

ORIGIN = Provenance("x", "2026-11-21")


def verified(
    stored: dict[str, Head], now: dict[str, Head], seed: int = 1, near: float = 0.6, far: float = 1.6
) -> Report:
    """Report on a calibration that knows `stored` heads, by ten shots of the heads as they are now."""
    random = np.random.default_rng(seed)
    seen = look(now, random_boards(10, random, near, far), random)
    sensors = {
        name: rig_file.SensorCalibration(
            head.camera, residuals=rig_file.Residuals(corners_px=head.corner_sigma * np.sqrt(2))
        )
        for name, head in stored.items()
    }
    known = rig_file.RigCalibration("lab", sensors, ORIGIN, "good")
    return verification.verify(known, BoardObservations(tuple(seen.corners), tuple(seen.planes)), ORIGIN)


def test_a_print_that_is_longer_along_one_axis_is_named_and_no_other_size_of_its_squares() -> None:
    random = np.random.default_rng(4)
    heads = {name: replace(three_heads()[name], depth_sigma=0.0) for name in ("light", "color")}
    seen = look(heads, random_boards(12, random), random)
    described = [replace(view, points_b=view.points_b / (1.01, 1, 1)) for view in seen.corners]
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in heads.items()}
    known = rig_file.RigCalibration("lab", sensors, ORIGIN, "good")
    (only,) = verification.verify(known, BoardObservations(tuple(described), tuple(seen.planes)), ORIGIN).verdicts
    assert only.level == Level.BAD
    assert only.text.startswith("The board's rows are ")
    assert "% longer than described, compared with its columns" in only.text


@pytest.mark.parametrize("mistake", ["geometry", "displaced", "mirrored"])
def test_mistakes_in_the_distances_are_named_and_no_other_scale_of_them(mistake: str) -> None:
    random = np.random.default_rng(4)
    heads = {name: head for name, head in three_heads().items() if name != "light"}
    seen = look(heads, random_boards(10, random), random)
    tof = heads["tof"].camera
    spoil: Callable[[PlaneView], PlaneView] = {
        "geometry": lambda view: replace(view, distances=view.distances * tof.directions(view.pixels)[:, 2]),
        "displaced": lambda view: replace(view, pixels=view.pixels + np.array([6, 0])),
        "mirrored": lambda view: replace(view, pixels=np.abs(view.pixels - (tof.width - 1, 0))),
    }[mistake]
    planes = [spoil(view) for view in seen.planes]
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in heads.items()}
    known = rig_file.RigCalibration("lab", sensors, ORIGIN, "good")
    worst, *others = verification.verify(known, BoardObservations(tuple(seen.corners), tuple(planes)), ORIGIN).verdicts
    said = {
        "geometry": "its distances look like z",
        "displaced": "its depth image is displaced by (+",
        "mirrored": "its distances miss the boards by ",
    }[mistake]
    assert (worst.level, worst.about) == (Level.BAD, "tof")
    assert worst.text.startswith(said)
    assert all(other.level == Level.GOOD for other in others)


def aligned() -> dict[str, Head]:
    color = three_heads()["color"]
    return {"color": color, "depth": Head(color.camera, depth_sigma=0.004)}


def test_an_aligned_depth_image_that_is_too_long_is_said_to_measure_wrongly() -> None:
    heads = aligned()
    report = verified(heads, {**heads, "depth": replace(heads["depth"], depth_scale=0.01)})
    worst = report.verdicts[0]
    assert (worst.level, worst.about) == (Level.BAD, "depth")
    assert worst.text.startswith("measures distances wrongly, by +0.9")
    assert "the squares of the board are 1.0" in worst.text
    assert worst.advice.startswith("Measure the squares with a ruler")
    assert "warm up" in worst.advice
    assert not any("moved" in one.text or "no longer stand" in one.text for one in report.verdicts)


def test_a_camera_that_was_zoomed_is_said_to_have_another_focal_length() -> None:
    focal = Hypothesis(Kind.FOCAL, ("color",), ((0,), (1,)), (920.0, 919.0))
    zoomed = Explanation(focal, np.array([0.005]), np.array([2e-4]), np.zeros(3), 0.0)
    (said,) = causes.verdicts(Comparison((zoomed,), 0.0, 0.0, 1.0), Level.DOUBTFUL, {})
    assert (said.about, said.text) == ("color", "has another focal length, by +0.50 ± 0.02 %.")
    assert said.advice.startswith("Was it refocused, zoomed")
    moved = Explanation(Hypothesis(Kind.MOVED, ("color",)), np.zeros(6), np.ones(6), np.zeros(3), 0.0)
    (said,) = causes.verdicts(Comparison((zoomed, moved), 0.0, 0.0, 1.0), Level.DOUBTFUL, {})
    assert "These shots cannot tell that from this: color has moved" in said.text
    assert said.advice == "To tell, show the board to all sensors much nearer and much further, and tilted every way."


def test_a_focal_length_that_its_own_corners_contradict_is_no_rival() -> None:
    """Of a left camera that was zoomed by 1 % it was said that the right one might have been, by -1 %."""
    both = [
        Explanation(
            Hypothesis(Kind.FOCAL, (name,), ((0,), (1,)), (920.0, 919.0)),
            np.array([size]),
            np.ones(1),
            np.zeros(3),
            0.0,
        )
        for name, size in (("left", 0.01), ("right", -0.01))
    ]
    found = Comparison(both, 0.0, 0.0, 1.0)
    assert "cannot tell that from this: right" in causes.verdicts(found, Level.BAD, {})[0].text
    (said,) = causes.verdicts(found.without_focal({"right": 0.001}), Level.BAD, {})
    assert (said.about, said.text[:28]) == ("left", "has another focal length, by")
    assert "right" not in said.text
    assert len(found.without_focal({"right": 0.02}).explanations) == 2


def test_what_cannot_be_told_apart_is_said_with_the_shots_that_would() -> None:
    heads = aligned()
    report = verified(heads, {**heads, "depth": replace(heads["depth"], depth_scale=0.01)}, 0, 0.95, 1.05)
    worst = report.verdicts[0]
    assert "cannot tell that from this: " in worst.text
    assert "; depth measures distances wrongly, by +" in worst.text
    assert "To tell, show depth the board much nearer than 1.00 m" in worst.advice


def test_a_rig_that_is_as_it_was_has_no_cause_named() -> None:
    assert {one.level for one in verified(three_heads(), three_heads()).verdicts} == {Level.GOOD}


def nudged(boards: Mapping[int, Pose], random: np.random.Generator) -> dict[int, Pose]:
    """Boards in a hand, a moment later."""
    return {shot: pose.from_rotation_vector((0, 0, 0), random.normal(0, 0.006, 3)) @ T for shot, T in boards.items()}


def test_images_of_different_moments_are_told_from_a_sensor_that_moved() -> None:
    random = np.random.default_rng(3)
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    boards = random_boards(10, random)
    first = look({"light": heads["light"]}, boards, random)
    late = look({"color": heads["color"]}, nudged(boards, random), random)
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in heads.items()}
    seen = BoardObservations((*first.corners, *late.corners), ())
    report = verification.verify(rig_file.RigCalibration("lab", sensors, ORIGIN), seen, ORIGIN)
    said = " ".join(one.text for one in report.verdicts)
    assert "were not taken at the same moment" in said
    assert "moved" not in said
    assert report.verdicts[0].level > Level.GOOD


def test_a_pair_of_images_that_contradicts_the_others_is_named_and_moves_no_sensor() -> None:
    random = np.random.default_rng(3)
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    boards = random_boards(12, random)
    first = look({"light": heads["light"]}, boards, random)
    late = look({"color": heads["color"]}, {**boards, 4: boards[9], 9: boards[4]}, random)
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in heads.items()}
    seen = BoardObservations((*first.corners, *late.corners), ())
    report = verification.verify(rig_file.RigCalibration("lab", sensors, ORIGIN), seen, ORIGIN)
    doubtful = [one for one in report.verdicts if one.level > Level.GOOD]
    assert len(doubtful) == 1
    assert "shot 4: corners of" in doubtful[0].text
    assert "belongs to shot 9" in doubtful[0].text
    assert doubtful[0].advice.endswith("--skip 4,9.")


def seen_with(size: float, heads: dict[str, Head]) -> Report:
    """Report on ten shots of a rig that is as it was, and a board that is larger than described by a factor."""
    random = np.random.default_rng(5)
    seen = look(heads, random_boards(10, random), random)
    corners = tuple(replace(view, points_b=view.points_b / size) for view in seen.corners)
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in heads.items()}
    known = rig_file.RigCalibration("lab", sensors, ORIGIN, "good")
    return verification.verify(known, BoardObservations(corners, tuple(seen.planes)), ORIGIN)


def test_a_board_of_another_size_is_no_motion_and_no_distance_bias() -> None:
    heads = {name: head for name, head in three_heads().items() if name != "light"}
    worst, *others = seen_with(0.97, heads).verdicts
    assert worst.level == Level.BAD
    assert worst.text.startswith("The squares of the board are 0.970")
    assert "cannot tell" not in worst.text
    assert {one.level for one in others} == {Level.GOOD}


@pytest.mark.parametrize("size", [0.1, 1.3, 25.4])
@pytest.mark.parametrize("sensors", [("light", "color"), ("tof",)])
def test_a_board_in_another_unit_is_told_from_everything_else(size: float, sensors: tuple[str, ...]) -> None:
    (worst,) = seen_with(size, {name: three_heads()[name] for name in sensors}).verdicts
    assert worst.text.startswith(f"The squares of the board are about {size:.3g} times as large as described")


def test_a_sensor_that_is_bumped_between_the_shots_is_said_to_have_moved_then() -> None:
    heads = {name: head for name, head in three_heads().items() if name != "tof"}
    color = heads["color"]
    turn = pose.from_rotation_vector((0, np.radians(0.3), 0), np.zeros(3))
    after = {**heads, "color": replace(color, camera=replace(color.camera, T_rs=color.camera.T_rs @ turn))}
    random = np.random.default_rng(1)
    boards = random_boards(16, random)
    seen = [
        view
        for now, shots in ((heads, range(8)), (after, range(8, 16)))
        for view in look(now, {shot: boards[shot] for shot in shots}, random).corners
    ]
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in heads.items()}
    known = rig_file.RigCalibration("lab", sensors, ORIGIN, "good")
    report = verification.verify(known, BoardObservations(tuple(seen), ()), ORIGIN)
    worst = report.verdicts[0]
    assert (worst.level, worst.about) == (Level.BAD, "light and color")
    assert worst.text.startswith("moved to each other during these shots, from about shot 8 on: ")
    assert not any("0.0 mm and 0.00°" in verdict.text for verdict in report.verdicts)
