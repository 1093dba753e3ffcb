"""The simulated calibration board: detected corners and measured distances against its true pose."""

import numpy as np
import pytest
from numpy.typing import NDArray

from calib import pose
from calib.board.corners.detection import detect
from drivers.contract.device import AddressError
from drivers.contract.frame import Frame, Kind
from drivers.simulated.address import parse
from drivers.simulated.scene.board_motion import MOVE_S
from drivers.simulated.shapes.printed import TARGETS, board_pose


def simulation(board: str, *more: str):
    return parse("&".join([f"simulated://target?board={board}", *more])).build()


def pixels_of(frame: Frame) -> NDArray[np.integer]:
    return frame.data.view(np.uint8 if frame.kind == Kind.COLOR else np.uint16)


@pytest.mark.parametrize("board", sorted(TARGETS))
def test_corners_agree_with_the_true_pose(board: str) -> None:
    made = simulation(board, "sensors=color,ir", "color=640x480", "ir=640x480", "rate=0.5", "seed=3")
    target = TARGETS[board]
    for k in (0, 1, 2):
        T_rb = board_pose(made.scene.surfaces[0], target, made.time_ns(k) * 1e-9)
        for frame in made.frames(k):
            found = detect(target, pixels_of(frame))
            true = made.heads[frame.sensor].camera.project(pose.transform(T_rb, target.points()))[found.ids]
            assert np.sqrt(np.mean((found.pixels - true) ** 2)) < 0.1, (k, frame.sensor)


def test_the_small_amplitude_image_of_the_time_of_flight_head_shows_the_chessboard() -> None:
    made, target = simulation("chessboard", "sensors=tof", "rate=0.5", "seed=3"), TARGETS["chessboard"]
    errors = []
    for k in range(6):
        T_rb = board_pose(made.scene.surfaces[0], target, made.time_ns(k) * 1e-9)
        amplitude = next(frame for frame in made.frames(k) if frame.kind == Kind.AMPLITUDE)
        true = made.heads["tof"].camera.project(pose.transform(T_rb, target.points()))
        errors.append(detect(target, pixels_of(amplitude)).pixels - true)
    assert np.sqrt(np.mean(np.square(errors))) < 0.1


def test_distances_are_those_of_the_plane() -> None:
    made, target = simulation("chessboard", "sensors=tof", "noise=0"), TARGETS["chessboard"]
    k = 300
    T_rb = board_pose(made.scene.surfaces[0], target, made.time_ns(k) * 1e-9)
    camera = made.heads["tof"].camera
    depth = next(frame for frame in made.frames(k) if frame.kind == Kind.DEPTH).si()
    pixels = np.rint(camera.project(pose.transform(T_rb, target.points()))).astype(int)
    normal = T_rb[:3, 2]
    true = (normal @ T_rb[:3, 3]) / (camera.directions(pixels) @ normal)
    assert np.abs(depth[pixels[:, 1], pixels[:, 0]] - true).max() < 5.0 / 2**14


def test_it_is_held_still_moved_and_held_still() -> None:
    made = simulation("circles", "hold=2", "sensors=tof")
    surface = made.scene.surfaces[0]

    def still(first: float, last: float) -> bool:
        return np.allclose(*(board_pose(surface, TARGETS["circles"], t) for t in (first, last)), atol=1e-12)

    assert still(0, 1.99)
    assert not still(2, 2 + MOVE_S)
    assert still(2 + MOVE_S, 4 + MOVE_S - 0.01)
    assert not still(2.4, 2.5)


def test_keys_of_the_board_are_errors_in_other_scenes() -> None:
    with pytest.raises(AddressError, match="board means nothing in 'sheet'"):
        parse("simulated://sheet?board=circles")
