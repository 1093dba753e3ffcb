"""A sequence of E1 and what the tracker makes of it: the sheet is known at rest, so control points correspond."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from abs_service.tracker.detection.initial_detection import InitialDetection
from abs_service.tracker.mesh import Mesh
from abs_service.tracker.models.base import BOARD
from abs_service.tracker.models.nurbs import Nurbs
from calib.noise.base import DepthNoise
from calib.noise.intensity import GaussianIntensity
from calib.rig import Rig, Sensor
from drivers.contract.frame import Frame, FrameSet, Kind
from evaluation.scenes.geometries import ASPECT, MovingSheet
from evaluation.scenes.rendering import Renderer, View
from evaluation.scenes.surfaces import Sheet, SplineSurface, Wall
from evaluation.scenes.time_of_flight import SR4000, TimeOfFlight, frame_set

#: What is behind the sheet, and the largest value of the grey image [levels].
WALL, FULL_SCALE = Wall(2.0, 0.5, (90.0, 90.0, 90.0)), 255.0

#: Deviation of the grey image [levels].
GREY_DEVIATION = 4.0

#: Points of the rendering along the short and the long side: 0.5 sub-pixels apart.
DENSE = 420, 560

#: Exposures whose mean is the first frame, in which the sheet is at rest and its print is learnt.
REST = 100

RATE_HZ = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Print:
    """What a sheet looks like.

    Attributes:
        reflectivity: of the camera's own, infra-red light (h, w).
        grey: of the room's light [levels] (h, w).
    """

    reflectivity: NDArray[np.float64]
    grey: NDArray[np.float64]


def printed(generator: np.random.Generator) -> Print:
    """Black spots (0.05) on white (0.9) in infra-red, and something softer that everybody sees."""
    spots, soft = (_blobs(generator, size) for size in (6.0, 9.0))
    return Print(0.05 + 0.85 / (1 + np.exp(-4 * spots)), 128 + 100 * np.tanh(0.6 * soft))


def _blobs(generator: np.random.Generator, size: float) -> NDArray[np.float64]:
    """Smooth noise (96, 128) of zero mean and unit deviation; `size` of 128 is the sheet's width."""
    smooth = gaussian_filter(generator.standard_normal((96, 128)), size, mode="reflect")
    return (smooth - smooth.mean()) / smooth.std()


class Scene:
    """One sheet before one camera.

    Args:
        sheet: its motion.
        sensor: the camera.
        look: its print.
    """

    def __init__(self, sheet: MovingSheet, sensor: TimeOfFlight, look: Print):
        self.sheet = sheet
        self.sensor = sensor
        self._renderer = Renderer(SR4000, WALL)
        self._dense = SplineSurface((4, 4), 2, np.linspace(0, 1, DENSE[0]), np.linspace(0, 1, DENSE[1]))
        self._reflectivity = look.reflectivity
        self._color = np.repeat(look.grey[..., None], 3, axis=2)

    def control(self, k: int) -> NDArray[np.float64]:
        """True control points (4, 4, 3) [m] of frame k."""
        return self.sheet.control(k / RATE_HZ)

    def view(self, control: NDArray[np.float64]) -> View:
        """What the camera sees of a sheet with control points (4, 4, 3)."""
        return self._renderer.render(Sheet(self._dense.points(control), self._reflectivity, self._color))

    def frames(self, count: int, generator: np.random.Generator) -> Iterator[FrameSet]:
        """Distance, amplitude and grey image of so many frames; the first is the mean of many exposures at rest."""
        for k in range(count):
            view, exposures = self.view(self.control(k)), REST if k == 0 else 1
            t_ns = round((k + 1) * 1e9 / RATE_HZ)
            frames = frame_set(self.sensor.measure(view, generator, exposures), k, t_ns)
            noise = GREY_DEVIATION * generator.standard_normal(view.share.shape) / np.sqrt(exposures)
            grey = np.clip(view.color[..., 0] + noise, 0, FULL_SCALE).astype("<f4")
            image = Frame("tof", "intensity", Kind.INTENSITY, grey, "32FC1", t_ns, t_ns, k)
            yield replace(frames, frames={**frames.frames, image.key: image})


def rig_of(noise: DepthNoise) -> Rig:
    """The camera as two sensors: distances with this noise model, and a grey image of the room's light."""
    grey = GaussianIntensity("intensity", GREY_DEVIATION, 0.0, "passive", FULL_SCALE)
    sensors = (Sensor("tof", SR4000, noise), Sensor("tof/intensity", SR4000, grey))
    return Rig("geometries", {sensor.name: sensor for sensor in sensors})


@dataclass(frozen=True)
class KnownSheet:
    """Settings of a model whose sheet is known: `nurbs` with the true control points at rest.

    Attributes:
        width, distance: of the sheet at rest, see `Motion`.
        vertices: about how many vertices it has.
        inset: how far vertices keep away from the rim, as a share of the width; 0.02 are 1.7 pixels, and there no
            pixel is mixed.
    """

    width: float
    distance: float
    vertices: int = 600
    inset: float = 0.02

    @property
    def board(self) -> tuple[float, float]:
        """Any would do."""
        return BOARD

    @cached_property
    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Parameters u (rows,) and w (columns,) of the vertices."""
        rows = round(np.sqrt(self.vertices * ASPECT))
        columns = round(self.vertices / rows)
        return np.linspace(self.inset / ASPECT, 1 - self.inset / ASPECT, rows), np.linspace(
            self.inset, 1 - self.inset, columns
        )

    @property
    def control(self) -> NDArray[np.float64]:
        """Control points (4, 4, 3) [m] of a flat sheet of degree 2: they lie at the means of two successive knots."""
        at = np.array([0.0, 0.25, 0.75, 1.0]) - 0.5
        y, x = np.meshgrid(ASPECT * self.width * at, self.width * at, indexing="ij")
        return np.stack([x, y, np.full_like(x, self.distance)], axis=-1)

    @property
    def faces(self) -> NDArray[np.int32]:
        """Triangles (m, 3) between the vertices, whose normals point to the camera."""
        rows, columns = map(len, self.places)
        place = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
        a, b, c, d = (part.ravel() for part in (place[:-1, :-1], place[1:, :-1], place[1:, 1:], place[:-1, 1:]))
        return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])

    def build(self, detection: InitialDetection) -> Nurbs:
        """The model of the sheet, which lies exactly where the first frame shows it."""
        u, w = (part.ravel() for part in np.meshgrid(*self.places, indexing="ij"))
        points = SplineSurface((4, 4), 2, *self.places).points(self.control).reshape(-1, 3)
        unknown = np.full((len(points), 3), np.nan, np.float32)
        mesh = Mesh(points, self.faces, unknown, np.stack([w, ASPECT * u], axis=1))
        return Nurbs(mesh, self.control, np.ones((4, 4)), 2, u, w, np.zeros(len(u)))
