"""The available scenes and their settings."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from calib import pose
from drivers.simulated.scene.board_motion import BoardMotion
from drivers.simulated.scene.body import Surface
from drivers.simulated.scene.excursion import Excursion
from drivers.simulated.scene.motion import Motion
from drivers.simulated.scene.scene import REST_Z, Scene
from drivers.simulated.scene.texture import Texture, checkerboard, fine_pattern, printed_paper, smooth_pattern
from drivers.simulated.shapes.hand import Hand
from drivers.simulated.shapes.printed import TARGETS, paper_size, print_texture
from drivers.simulated.shapes.rectangle import Rectangle
from drivers.simulated.shapes.strip import Strip

#: Size of the wall's texture [m]; beyond it the edge texels are repeated.
_WALL = (4.0, 3.0)


@dataclass(frozen=True)
class SceneSettings:
    """Settings of a scene.

    Attributes:
        seed: random seed of motion and texture.
        bend: maximum bend of a sheet from end to end [rad].
        speed: factor on the speed of all motion.
        excursion: displacement of the surfaces in addition to their motion.
        hand: True if a hand crosses the view.
        texture: print of a sheet: `smooth`, `fine` or `paper`.
        stiffness: bending stiffness of the strip per width [N·m].
        weight: mass of the strip per area [kg/m²].
        distance, reflectivity, tilt: of the bare wall [m], [rad].
        printed: pattern of the calibration board, one of `TARGETS`.
        hold_s: duration of each of its poses [s].
        reach: lateral range of its poses.
    """

    seed: int = 1
    bend: float = np.deg2rad(60)
    speed: float = 1.0
    excursion: Excursion = field(default_factory=Excursion)
    hand: bool = False
    texture: str = "smooth"
    stiffness: float = 0.01
    weight: float = 0.3
    distance: float = 1.0
    reflectivity: float = 0.5
    tilt: float = 0.0
    printed: str = "chessboard"
    hold_s: float = 1.0
    reach: float = 1.0


def sheet(settings: SceneSettings) -> Scene:
    """A sheet of 0.30 × 0.20 m that bends by up to `settings.bend` while it moves and turns."""
    width, height = 0.30, 0.20
    motion = Motion(
        seed=settings.seed,
        rest=(0.0, 0.0, REST_Z),
        translation=(0.04, 0.03, 0.05),
        rotation=(np.deg2rad(13), np.deg2rad(13), np.deg2rad(10)),
        bend=settings.bend,
        width=width,
        height=height,
        turn=np.deg2rad(35),
        shift=0.02,
        speed=settings.speed,
    )
    pattern = _print(settings, settings.seed, width, height)
    return _scene(settings, Rectangle(width, height, motion, pattern, settings.excursion))


def board(settings: SceneSettings) -> Scene:
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
    return _scene(settings, Rectangle(width, height, motion, checkerboard(width, height, 0.05), settings.excursion))


def strip(settings: SceneSettings) -> Scene:
    """A strip of 0.30 × 0.05 m that hangs from a gripper towards the viewer and sags under its weight."""
    length, width = 0.30, 0.05
    pattern = smooth_pattern(settings.seed, length, width, (0.015, 0.006, 0.003), 1000.0, (0.1, 0.95), (0.5, 0.95))
    elastic = (settings.stiffness, settings.weight)
    return _scene(settings, Strip(settings.seed, length, width, *elastic, pattern, settings.speed, settings.excursion))


def pair(settings: SceneSettings) -> Scene:
    """Two sheets of 0.20 × 0.15 m side by side, at rest 8 cm apart, with independent motion and print."""
    width, height, middle = 0.20, 0.15, 0.14
    motions = [
        Motion(
            seed=settings.seed + number,
            rest=(side * middle, 0.0, REST_Z),
            translation=(0.015, 0.03, 0.05),
            rotation=(np.deg2rad(13), np.deg2rad(13), np.deg2rad(8)),
            bend=settings.bend,
            width=width,
            height=height,
            turn=np.deg2rad(35),
            shift=0.015,
            speed=settings.speed,
        )
        for number, side in enumerate((-1, 1))
    ]
    patterns = [_print(settings, motion.seed, width, height) for motion in motions]
    sheets = [Rectangle(width, height, *of_one, settings.excursion) for of_one in zip(motions, patterns)]
    return _scene(settings, *sheets)


def wall(settings: SceneSettings) -> Scene:
    """A bare wall of uniform brightness, for static sequences: `settings.distance` away and turned about y."""
    T_rw = pose.from_rotation_vector((0, settings.tilt, 0), (0, 0, settings.distance))
    return Scene((), Texture(np.full((2, 2, 4), settings.reflectivity, np.float32), 1.0), T_rw=T_rw)


def target(settings: SceneSettings) -> Scene:
    """A calibration board, `settings.printed`, that is held still in one pose after another."""
    board_ = TARGETS[settings.printed]
    width, height = paper_size(board_)
    board_motion = BoardMotion(settings.seed, width, height, settings.hold_s, settings.reach, settings.speed)
    return _scene(settings, Rectangle(width, height, board_motion, print_texture(board_), settings.excursion))


#: Scenes by their name in an address.
SCENES: Mapping[str, Callable[[SceneSettings], Scene]] = {
    "sheet": sheet,
    "board": board,
    "strip": strip,
    "pair": pair,
    "wall": wall,
    "target": target,
}


def _scene(settings: SceneSettings, *surfaces: Surface) -> Scene:
    hands = (Hand(settings.seed, surfaces, settings.speed),) if settings.hand else ()
    return Scene(surfaces, _wall(settings), hands)


def _print(settings: SceneSettings, seed: int, width: float, height: float) -> Texture:
    color, infrared = (0.1, 0.95), (0.35, 0.9)
    match settings.texture:
        case "fine":
            return fine_pattern(seed, width, height, color, infrared)
        case "paper":
            return printed_paper(seed, width, height)
    return smooth_pattern(seed, width, height, (0.025, 0.01, 0.004), 800.0, color, infrared)


def _wall(settings: SceneSettings) -> Texture:
    """Wall texture with less contrast than the sheet, in places too dark for a time-of-flight return."""
    color = (0.44, 0.5) if settings.texture == "paper" else (0.3, 0.6)
    return smooth_pattern(settings.seed + 1, *_WALL, (0.2, 0.05), 100.0, color=color, infrared=(0.12, 0.7))
