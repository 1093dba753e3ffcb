"""Sets of views: what is refused, what is missing in words, and what a further view adds."""

from dataclasses import replace

import numpy as np
import pytest

from calib import pose
from calib.board import coverage
from calib.board.board_pose_features import board_pose_features
from calib.board.mirrored import MirroredSensorError
from calib.board.target import Chessboard
from calib.board.views import CornerView
from drivers.simulated.address import parse
from drivers.simulated.shapes.printed import TARGETS, board_pose
from evaluation.scenes.boards.board_images import VGA, centered

BOARD = Chessboard(9, 6, 0.03)
SIZES = {"color": (640, 480)}


def view(rotation=(0.0, 0.0, 0.0), distance=0.7, shift=(0.0, 0.0), shot=0, sensor="color") -> CornerView:
    T_sb = centered(BOARD, rotation, distance)
    T_sb[:2, 3] += shift
    points = BOARD.points()
    return CornerView(sensor, shot, 0.0, points, VGA.project(pose.transform(T_sb, points)))


def many() -> list[CornerView]:
    """Tilted all ways, near and far, into all corners."""
    tilts = [(0.5, 0, 0), (-0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0)]
    shifted = [
        view(distance=0.7, shift=(0.2 * (x - 1), 0.15 * (y - 1)), shot=n) for n, (x, y) in enumerate(np.ndindex(3, 3))
    ]
    return shifted + [view(tilt, 0.45, shot=9 + n) for n, tilt in enumerate(tilts)]


def test_three_views_are_too_few() -> None:
    with pytest.raises(
        coverage.TooFewViewsError, match=r"color: 3 views of 3 distinct poses of the board, but .* 4 at the very least"
    ):
        coverage.check(many()[:3])


def test_views_that_are_all_alike_are_refused() -> None:
    alike = [view((0.1 + 0.01 * n, 0.1, 0.0), 0.7 + 0.01 * n, shot=n) for n in range(12)]
    with pytest.raises(coverage.ViewsAlikeError, match="color: all 12 views show the board in nearly the same pose"):
        coverage.check(alike)


def test_views_of_many_poses_are_enough() -> None:
    coverage.check(many())
    assert coverage.missing_views(many(), SIZES) == []


@pytest.mark.parametrize(
    ("rotation", "way"),
    [((0.0, 0.5, 0.0), "left"), ((0.0, -0.5, 0.0), "right"), ((-0.5, 0.0, 0.0), "up"), ((0.5, 0.0, 0.0), "down")],
)
def test_a_tilt_that_is_missing_is_asked_for(rotation, way: str) -> None:
    without = [one for one in many() if not np.allclose(one.pixels, view(rotation, 0.45).pixels)]
    assert len(without) == 12
    assert [wish.text for wish in coverage.missing_views(without, SIZES)] == [f"tilt the board more: let it face {way}"]


def test_a_corner_of_the_image_that_nobody_has_seen_is_named() -> None:
    without = [one for one in many() if coverage.counts([one], (640, 480), 3, 3)[0, 2] == 0]
    assert "nobody has seen the top right corner of color" in [w.text for w in coverage.missing_views(without, SIZES)]


def test_near_and_far_are_asked_for() -> None:
    far = [view(distance=1.5, shot=n) for n in range(12)]
    near = [view(distance=0.45, shot=n) for n in range(12)]
    assert "come closer" in [wish.text for wish in coverage.missing_views(far, SIZES)]
    assert "go further away" in [wish.text for wish in coverage.missing_views(near, SIZES)]


def test_sensors_have_to_see_the_board_together() -> None:
    others = [view(distance=0.6, shot=100 + n, sensor="tof") for n in range(12)]
    texts = [wish.text for wish in coverage.missing_views([*many(), *others], {**SIZES, "tof": (640, 480)})]
    assert "show the board to color and tof at the same time (0 of 6 times)" in texts
    texts = [wish.text for wish in coverage.missing_views(many(), {**SIZES, "tof": (640, 480)})]
    assert texts == ["show the board to tof: it has not seen it yet"]


def test_only_a_view_of_something_new_is_worth_keeping() -> None:
    kept = [view(), view((0.5, 0, 0))]
    assert not coverage.adds_information(view((0.02, 0.0, 0.0), 0.71), kept, (640, 480))
    assert coverage.adds_information(view((0.0, 0.4, 0.0)), kept, (640, 480))
    assert coverage.adds_information(view(shift=(0.25, 0.0)), kept, (640, 480))
    assert coverage.adds_information(view(sensor="tof"), kept, (640, 480))


def test_a_stance_tells_where_the_print_faces() -> None:
    left = board_pose_features(view((0.0, 0.5, 0.0), 0.6), (640, 480))
    assert left.tilt[0] == pytest.approx(-0.5, abs=0.1)
    assert left.tilt[1] == pytest.approx(0.0, abs=0.02)
    assert board_pose_features(view((0, 0, 0.3)), (640, 480)).roll == pytest.approx(0.3, abs=0.01)


def rolled(sensor: str, mirror: bool, roll: float = 0.5) -> list[CornerView]:
    """Many poses, rolled as well; mirrored as a driver does, and counted so that x and y are right-handed again."""
    found = []
    for n in range(8):
        one = view((0.3 * np.sin(n), 0.3 * np.cos(n), roll * np.sin(2 * n)), 0.7, shot=n, sensor=sensor)
        pixels = one.pixels * (-1, 1) + (639, 0) if mirror else one.pixels + (sensor == "tof")  # of another place
        lattice = pixels.reshape(6, 9, 2)
        found.append(replace(one, pixels=(lattice[:, ::-1] if mirror else lattice).reshape(-1, 2)))
    return found


def test_a_sensor_whose_images_are_mirrored_is_noticed() -> None:
    coverage.check([*rolled("color", mirror=False), *rolled("tof", mirror=False)])
    with pytest.raises(MirroredSensorError, match="color or tof sees the board as in a mirror"):
        coverage.check([*rolled("color", mirror=False), *rolled("tof", mirror=True)])
    # A board that was never rolled does not show it.
    coverage.check([*rolled("color", mirror=False, roll=0.02), *rolled("tof", mirror=True, roll=0.02)])


def test_images_of_one_sensor_that_are_given_for_two_are_noticed() -> None:
    views = [*many(), *(replace(one, sensor="tof") for one in many())]
    with pytest.raises(coverage.SameImagesError, match="color and tof have the same images"):
        coverage.check(views)


def test_images_that_were_compressed_anew_are_the_same_images() -> None:
    random = np.random.default_rng(0)
    copies = [replace(one, sensor="tof", pixels=one.pixels + random.normal(0, 0.1, one.pixels.shape)) for one in many()]
    with pytest.raises(coverage.SameImagesError, match="color and tof have the same images"):
        coverage.check([*many(), *copies])
    coverage.check([*many(), *(replace(one, pixels=one.pixels + 0.5) for one in copies)])


def test_the_simulated_board_is_shown_in_all_poses_that_are_needed() -> None:
    simulation = parse("simulated://target?sensors=tof,color&reach=1.5").build()
    target, surface = TARGETS["chessboard"], simulation.scene.surfaces[0]
    sizes = {name: (head.camera.width, head.camera.height) for name, head in simulation.heads.items()}
    views: list[CornerView] = []
    for n in range(30):
        T_rb = board_pose(surface, target, 2.0 * n + 0.5)
        for name, head in simulation.heads.items():
            pixels = head.camera.project(pose.transform(T_rb, target.points()))
            if (pixels > 3).all() and (pixels < np.array(sizes[name]) - 4).all():
                views.append(CornerView(name, n, 0.0, target.points(), pixels))
    assert coverage.missing_views(views, sizes) == []
