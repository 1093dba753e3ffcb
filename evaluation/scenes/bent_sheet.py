"""A sheet of known shape that bends to an arc while it moves, as a depth camera sees it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy  # its parts are imported when they are first used
from numpy.typing import NDArray

from calib.camera import Camera
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import Sheet, Wall

#: Width and height of the sheet [m].
SIZE = (0.3, 0.2)

#: Vertices along either side of the template that all trackers begin with; the outermost are on the sheet's rim.
SIDE = 20

#: Time between two frames [s].
INTERVAL_S = 1 / 30

CAMERA = Camera(176, 144, 183.0, 183.0, 87.5, 71.5)

#: What is behind the sheet.
WALL = Wall(1.6)

#: Below this angle an arc is computed as its series: the formula would divide rounding errors by next to nothing [rad].
_FLAT = 1e-6


def places(columns: int, rows: int) -> NDArray[np.float64]:
    """Places (rows, columns, 2) [m] on the flat sheet, from its centre on, in a grid that ends at its rim."""
    sides = (np.linspace(-0.5, 0.5, count) * size for count, size in zip((columns, rows), SIZE))
    return np.stack(np.meshgrid(*sides), axis=-1)


class State(Protocol):
    """A sheet at one state."""

    def points(self, material: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (…, 3) [m] of material points (…, 2) [m]."""
        ...

    def material(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Places (n, 2) [m] on the sheet of points on it (n, 3) [m]."""
        ...


@dataclass(frozen=True, slots=True)
class SheetState:
    """The sheet, bent to an arc.

    Attributes:
        angle: by how much the normals of its two short sides differ [rad]; positive ends bend towards the camera.
        turn: rotation vector of the sheet about its centre [rad].
        center: where its centre is [m].
    """

    angle: float
    turn: tuple[float, float, float]
    center: tuple[float, float, float]

    def points(self, material: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (…, 3) [m] of material points (…, 2) [m]: on a cylinder, so the bending is isometric."""
        along, across = material[..., 0], material[..., 1]
        if abs(self.angle) < _FLAT:
            bent = np.stack([along, across, np.zeros_like(along)], axis=-1)
        else:
            radius = SIZE[0] / self.angle
            bent = np.stack([radius * np.sin(along / radius), across, radius * (np.cos(along / radius) - 1)], axis=-1)
        return scipy.spatial.transform.Rotation.from_rotvec(self.turn).apply(bent.reshape(-1, 3)).reshape(
            bent.shape
        ) + np.array(self.center)

    def material(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Places (n, 2) [m] of points (n, 3) [m]; of a flat sheet only."""
        middle, right, down = self.points(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
        return (points - middle) @ np.stack([right - middle, down - middle], axis=1)


#: The sheet by the time [s].
SheetMotion = Callable[[float], State]


def swing(t: float) -> SheetState:
    """Bends to +120° and to −120° in 40 frames and sways meanwhile; flat in the first."""
    phase = 2 * np.pi * t / (40 * INTERVAL_S)
    turn = (0.15 * np.sin(0.7 * phase), 0.25 * np.sin(phase + 0.5) - 0.12, 0.1 * np.sin(0.5 * phase))
    center = (0.03 * np.sin(0.6 * phase), 0.02 * (1 - np.cos(0.8 * phase)), 1 + 0.03 * np.sin(0.9 * phase))
    return SheetState(float(np.deg2rad(120) * np.sin(phase)), turn, center)


@dataclass(frozen=True)
class SheetScene:
    """A swinging sheet before a wall, and the camera's noise and dropouts.

    Attributes:
        name: in tables.
        motion: of the sheet.
        sigma: standard deviation of the ray lengths [m].
        hole: columns and rows of a window in the middle of the image without returns [px]; zero: none.
        wall: behind the sheet.
        dropouts: share of the pixels without a return, in all frames but the first, each independently.
    """

    name: str
    motion: SheetMotion = swing
    sigma: float = 5e-3
    hole: tuple[int, int] = (0, 0)
    wall: Wall = WALL
    dropouts: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class SheetFrame:
    """One frame with its truth.

    Attributes:
        t_ns: its time [ns].
        distance: measured radial distances (height, width) [m], NaN without return.
        sheet: mask (height, width) of the pixels that show the sheet.
        hole: mask (height, width) of the pixels without return because of the hole.
        state: the sheet.
    """

    t_ns: int
    distance: NDArray[np.float32]
    sheet: NDArray[np.bool_]
    hole: NDArray[np.bool_]
    state: State

    @property
    def cloud(self) -> NDArray[np.float64]:
        """Points (k, 3) [m] that were measured on the sheet: a perfect segmentation, which point sets need."""
        return CAMERA.unproject(self.distance)[self.sheet]


def render_frames(scene: SheetScene, indices: Iterable[int], generator: np.random.Generator) -> list[SheetFrame]:
    """Frames of a scene at the given indices."""
    renderer = Renderer(CAMERA, scene.wall, fineness=1)
    dense = places(181, 121)
    rows, columns = np.indices((CAMERA.height, CAMERA.width))
    across, down = scene.hole
    hole = (np.abs(columns - CAMERA.cx) < across / 2) & (np.abs(rows - CAMERA.cy) < down / 2)
    frames = []
    for k in indices:
        state = scene.motion(k * INTERVAL_S)
        view = renderer.render(Sheet(state.points(dense)))
        measured = view.distance + scene.sigma * generator.standard_normal(hole.shape)
        sheet = (view.share > 0) & ~hole
        lost = hole | _dropouts(scene.dropouts if k else 0.0, hole.shape, generator)
        distance = np.where(lost, np.nan, measured).astype(np.float32)
        frames.append(SheetFrame(round(k * INTERVAL_S * 1e9), distance, sheet, hole, state))
    return frames


def _dropouts(share: float, shape: tuple[int, ...], generator: np.random.Generator) -> NDArray[np.bool_]:
    """A share of the pixels; without any, nothing is drawn, so that scenes stay what they are."""
    return generator.random(shape) < share if share else np.zeros(shape, np.bool_)


def _eased(t: float, begin: float, duration: float) -> float:
    """Smooth step from 0 to 1 during an interval."""
    return float(0.5 - 0.5 * np.cos(np.pi * np.clip((t - begin) / duration, 0, 1)))


def turn(t: float) -> SheetState:
    """Turns by 90° about the vertical axis within a quarter of a second, a little bent."""
    angle = np.deg2rad(-45 + 90 * _eased(t, 0.2, 0.25))
    return SheetState(float(np.deg2rad(40)), (0.0, float(angle), 0.0), (0.0, 0.0, 1.0))


def spin(t: float) -> SheetState:
    """Turns by 90° about the line of sight within a quarter of a second, a little bent."""
    return SheetState(float(np.deg2rad(40)), (0.0, 0.0, float(np.deg2rad(90 * _eased(t, 0.2, 0.25)))), (0.0, 0.0, 1.0))


class Leap:
    """Jump of the sheet to another place in the third frame: it was out of sight, or nobody looked.

    It was moved by up to 20 cm, turned by up to 75° about the line of sight and tilted by up to 34°, and is bent by up
    to ±110° instead of up to ±40°.
    """

    def __init__(self, generator: np.random.Generator):
        def within(*sizes: float) -> tuple[float, float, float]:
            x, y, z = generator.uniform(-1, 1, 3) * sizes
            return float(x), float(y), float(z)

        bends = generator.uniform(-1, 1, 2) * np.deg2rad([40, 110])
        x, y, z = within(0.05, 0.03, 0.05)
        turn = within(0.2, 0.3, 0.3)
        tilt_x, tilt_y, about_sight = within(0.4, 0.6, 1.3)
        aside, down, away = within(0.05, 0.06, 0.15)
        self._before = SheetState(float(bends[0]), turn, (x, y, 1 + z))
        self._after = SheetState(
            float(bends[1]),
            (tilt_x, tilt_y, turn[2] + about_sight),
            (float(-np.sign(x)) * (0.075 + aside), down, 1 + away),
        )

    def __call__(self, t: float) -> SheetState:
        """The sheet at a time [s]."""
        return self._before if t < 2.5 * INTERVAL_S else self._after
