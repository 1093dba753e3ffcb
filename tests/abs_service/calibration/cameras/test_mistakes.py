"""Mistakes in the images of `calibrate verify` are named, and not taken for a sensor that moved."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from abs_service.calibration.cameras import new_views, verification
from abs_service.calibration.files import rig_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.content import Level, Report
from abs_service.report.provenance import Provenance
from calib.board.corners import errors
from calib.board.views import CornerView
from calib.calibration_check import mistakes
from calib.calibration_check.stored_calibration import Views
from calib.lenses.lens import Lens
from calib.pose import Pose
from calib.solve.start.board_poses import pose_candidates
from evaluation.scenes.boards.board_views import Head, board_points, look, random_boards, three_heads

ORIGIN = Provenance("x", "2026-11-21")


def two_heads() -> dict[str, Head]:
    """Two cameras with images of one size."""
    heads = three_heads()
    left = heads["light"].camera
    right = replace(heads["color"].camera, width=640, height=480, fx=560.0, fy=559.0, cx=318.0, cy=243.0)
    return {"left": Head(left, 0.1), "right": Head(right, 0.1)}


def verified(change: Callable[[CornerView], CornerView], seen: BoardObservations | None = None) -> Report:
    """Report on ten shots of a rig that is as it was, whose views are changed."""
    corners = tuple(map(change, look(two_heads(), *_boards()).corners))
    return verification.verify(calibration(), BoardObservations(corners) + (seen or BoardObservations()), ORIGIN)


def calibration() -> rig_file.RigCalibration:
    sensors = {name: rig_file.SensorCalibration(head.camera) for name, head in two_heads().items()}
    return rig_file.RigCalibration("lab", sensors, ORIGIN, "good")


def _boards() -> tuple[dict[int, Pose], np.random.Generator]:
    random = np.random.default_rng(4)
    return random_boards(10, random), random


def exchanged(view: CornerView) -> CornerView:
    return replace(view, sensor={"left": "right", "right": "left"}[view.sensor])


def mirrored(view: CornerView) -> CornerView:
    """Views as a detector numbers the board's mirror image."""
    if view.sensor != "right":
        return view
    points_b = view.points_b * (-1, 1, 1) + (board_points()[:, 0].max(), 0, 0)
    return replace(view, pixels=(639, 0) + view.pixels * (-1, 1), points_b=points_b)


def turned(view: CornerView) -> CornerView:
    return replace(view, pixels=(639, 479) - view.pixels) if view.sensor == "left" else view


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (exchanged, "The images of left seem to be those of right and the other way round"),
        (mirrored, "Right seems to show the board as in a mirror"),
        (turned, "The images of left seem to be turned by 180°"),
    ],
)
def test_a_mistake_is_named_instead_of_a_motion(change: Callable[[CornerView], CornerView], said: str) -> None:
    worst, *others = verified(change).verdicts
    assert worst.level == Level.BAD
    assert worst.text.startswith(said)
    assert not others


def test_the_images_of_one_sensor_given_for_two_are_named() -> None:
    pixels = {view.shot: view for view in look({"left": two_heads()["left"]}, *_boards()).corners}
    (worst,) = verified(lambda view: replace(pixels[view.shot], sensor=view.sensor)).verdicts
    assert worst.text.startswith("Left and right have the same images.")


def test_a_sensor_without_views_is_said_with_the_reasons() -> None:
    report = verified(
        lambda view: replace(view, sensor="left", shot=view.shot + 20 * (view.sensor == "right")),
        BoardObservations(rejected={(k, "right"): errors.BlurredError("blurred") for k in range(3)}),
    )
    assert any("did not see the board (blurred in 3)" in one.text and one.about == "right" for one in report.verdicts)


def test_the_images_of_another_sensor_are_named_without_common_shots() -> None:
    given = look({"right": two_heads()["right"]}, *_boards()).corners
    stored = new_views.stored_in(calibration())
    assert mistakes.likelier(stored, Views([replace(view, sensor="left") for view in given], ()), "left") == "right"
    assert not mistakes.likelier(stored, Views(given, ()), "right")


def test_a_camera_that_could_not_have_seen_another_ones_corners_is_not_likelier() -> None:
    right = two_heads()["right"]
    narrow = replace(two_heads()["left"].camera, lens=Lens(np.array([-0.8])))  # no light beyond 250 px from the middle
    given = look({"right": right}, *_boards()).corners
    assert any(not pose_candidates(narrow, view) for view in given)
    sensors = {"left": rig_file.SensorCalibration(narrow), "right": rig_file.SensorCalibration(right.camera)}
    stored = new_views.stored_in(rig_file.RigCalibration("lab", sensors, ORIGIN, "good"))
    assert not mistakes.likelier(stored, Views(given, ()), "right")


def test_views_that_the_stored_camera_could_not_have_seen_are_counted() -> None:
    seen = look(two_heads(), *_boards()).corners
    used = [view for view in seen if view.sensor == "right" or view.shot not in {2, 5}]
    (verdict,) = new_views.verdicts(calibration(), BoardObservations(tuple(seen)), Views(used, ()))
    assert (verdict.level, verdict.about) == (Level.DOUBTFUL, "left")
    assert "2 of 10 images" in verdict.text
    assert "(shots 2, 5)" in verdict.text


@pytest.mark.parametrize(("kept", "level"), [(20, Level.DOUBTFUL), (8, Level.GOOD)])
def test_images_that_the_calibration_was_made_from_do_not_verify_it(kept: int, level: Level) -> None:
    seen = look(two_heads(), *_boards()).corners
    covariance = rig_file.Covariance(("left.fx",), np.eye(1), tuple(view.digest for view in seen[:kept]))
    known = replace(calibration(), covariance=covariance)
    report = verification.verify(known, BoardObservations(tuple(seen)), ORIGIN)
    assert report.level == level
    said = [one for one in report.verdicts if f"{kept} of 20 images are those that it was made from" in one.text]
    assert len(said) == (level == Level.DOUBTFUL)
