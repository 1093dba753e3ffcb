"""The available scenes."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from calib import pose
from drivers.simulated.scene.board_motion import BoardMotion
from drivers.simulated.scene.body import Surface
from drivers.simulated.scene.excursion import Excursion
from drivers.simulated.scene.motion import Motion
from drivers.simulated.scene.scene import REST_Z, Scene
from drivers.simulated.scene.texture import Texture, checkerboard, fine_pattern, printed_paper, smooth_pattern
from drivers.simulated.settings import Settings
from drivers.simulated.shapes.hand import Hand
from drivers.simulated.shapes.printed import TARGETS, paper_size, print_texture
from drivers.simulated.shapes.rectangle import Rectangle
from drivers.simulated.shapes.strip import Strip

#: Size of the wall's texture [m]; beyond it the edge texels are repeated.
_WALL = (4.0, 3.0)


def sheet(settings: Settings) -> Scene:
    """A sheet of 0.30 × 0.20 m that bends by up to `settings.bend` while it moves and turns."""
    width, height = 0.30, 0.20
    motion = Motion(
        seed=settings.seed,
        rest=(0.0, 0.0, REST_Z),
        translation=(0.04, 0.03, 0.05),
        rotation=(np.deg2rad(13), np.deg2rad(13), np.deg2rad(10)),
        bend=math.radians(settings.bend),
        width=width,
        height=height,
        turn=np.deg2rad(35),
        shift=0.02,
        speed=settings.speed,
    )
    pattern = _print(settings, settings.seed, width, height)
    return _scene(settings, Rectangle(width, height, motion, pattern, _excursion(settings)))


def board(settings: Settings) -> Scene:
    """A rigid checkerboard of 0.30 × 0.20 m, squares of 50 mm, that moves and turns."""
    width, height = 0.30, 0.20
    motion = Motion(
        seed=settings.seed,
        rest=(0.0, 0.0, REST_Z),
        translation=(0.06, 0.05, 0.08),
        rotation=(np.deg2rad(20), np.deg2rad(20), np.deg2rad(15)),
        bend=0.0,
        width=width,
        height=height,
        turn=0.0,
        shift=0.0,
        speed=settings.speed,
    )
    return _scene(settings, Rectangle(width, height, motion, checkerboard(width, height, 0.05), _excursion(settings)))


def strip(settings: Settings) -> Scene:
    """A strip of 0.30 × 0.05 m that hangs from a gripper towards the viewer and sags under its weight."""
    length, width = 0.30, 0.05
    pattern = smooth_pattern(settings.seed, length, width, (0.015, 0.006, 0.003), 1000.0, (0.1, 0.95), (0.5, 0.95))
    elastic = (settings.stiffness, settings.weight)
    return _scene(
        settings, Strip(settings.seed, length, width, *elastic, pattern, settings.speed, _excursion(settings))
    )


def pair(settings: Settings) -> Scene:
    """Two sheets of 0.20 × 0.15 m side by side, at rest 8 cm apart, with independent motion and print."""
    width, height, middle = 0.20, 0.15, 0.14
    motions = [
        Motion(
            seed=settings.seed + number,
            rest=(side * middle, 0.0, REST_Z),
            translation=(0.015, 0.03, 0.05),
            rotation=(np.deg2rad(13), np.deg2rad(13), np.deg2rad(8)),
            bend=math.radians(settings.bend),
            width=width,
            height=height,
            turn=np.deg2rad(35),
            shift=0.015,
            speed=settings.speed,
        )
        for number, side in enumerate((-1, 1))
    ]
    patterns = [_print(settings, motion.seed, width, height) for motion in motions]
    sheets = [Rectangle(width, height, *of_one, _excursion(settings)) for of_one in zip(motions, patterns)]
    return _scene(settings, *sheets)


def wall(settings: Settings) -> Scene:
    """A bare wall of uniform brightness, for static sequences: `settings.distance` away and turned about y."""
    T_rw = pose.from_rotation_vector((0, math.radians(settings.tilt), 0), (0, 0, settings.distance))
    return Scene((), Texture(np.full((2, 2, 4), settings.reflectivity, np.float32), 1.0), T_rw=T_rw)


def target(settings: Settings) -> Scene:
    """A calibration board, `settings.board`, that is held still in one pose after another."""
    board_ = TARGETS[settings.board]
    width, height = paper_size(board_)
    board_motion = BoardMotion(settings.seed, width, height, settings.hold, settings.reach, settings.speed)
    return _scene(settings, Rectangle(width, height, board_motion, print_texture(board_), _excursion(settings)))


#: Scenes by their name in an address.
SCENES: Mapping[str, Callable[[Settings], Scene]] = {
    "sheet": sheet,
    "board": board,
    "strip": strip,
    "pair": pair,
    "wall": wall,
    "target": target,
}


def _scene(settings: Settings, *surfaces: Surface) -> Scene:
    hands = (Hand(settings.seed, surfaces, settings.speed),) if settings.occluder == "hand" else ()
    return Scene(surfaces, _wall(settings), hands)


def _excursion(settings: Settings) -> Excursion:
    return Excursion(settings.turn, settings.leave)


def _print(settings: Settings, seed: int, width: float, height: float) -> Texture:
    color, infrared = (0.1, 0.95), (0.35, 0.9)
    match settings.texture:
        case "fine":
            return fine_pattern(seed, width, height, color, infrared)
        case "paper":
            return printed_paper(seed, width, height)
    return smooth_pattern(seed, width, height, (0.025, 0.01, 0.004), 800.0, color, infrared)


def _wall(settings: Settings) -> Texture:
    """Wall texture with less contrast than the sheet, in places too dark for a time-of-flight return."""
    color = (0.44, 0.5) if settings.texture == "paper" else (0.3, 0.6)
    return smooth_pattern(settings.seed + 1, *_WALL, (0.2, 0.05), 100.0, color=color, infrared=(0.12, 0.7))
