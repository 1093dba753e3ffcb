"""A printed sheet of rubber: its material moves within the sheet, so that it stretches, while it sways and bends."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from evaluation.scenes.bent_sheet import CAMERA, INTERVAL_S, SIZE, WALL, SheetFrame, SheetState, places
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import Sheet

#: Standard deviations of the ray lengths [m] and of the colours [levels].
SIGMA, COLOR_SIGMA = 3e-3, 3.0

#: Time in which it stretches and is as it was again [s], and how far away its middle is [m].
PERIOD_S, AWAY_M = 2.0, 0.7

#: Where material places (…, 2) [m] are within the sheet when it is stretched by a share, 0…1.
Strain = Callable[[NDArray[np.float64], float], NDArray[np.float64]]


def lengthened(material: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Longer by a tenth, and narrower."""
    return material * [1 + 0.1 * share, 1 - 0.04 * share]


def sheared(material: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Sheet whose long sides are shifted against each other by 15 % of its width."""
    x, y = np.moveaxis(material, -1, 0)
    return np.stack([x + 0.15 * share * y, y], axis=-1)


def twisted(material: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Sheet whose middle is turned by 30° within it."""
    x, y = np.moveaxis(material, -1, 0)
    turn = np.deg2rad(30) * share * np.exp(-np.sum(material**2, axis=-1) / 0.06**2)
    return np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y], axis=-1)


def uneven(material: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """One half longer and the other shorter, its middle 15 mm off."""
    x, y = np.moveaxis(material, -1, 0)
    return np.stack([x + 0.015 * share * np.cos(np.pi * x / SIZE[0]), y], axis=-1)


STRAINS: dict[str, Strain] = {
    "is lengthened": lengthened, "is sheared": sheared, "is twisted": twisted, "is lengthened unevenly": uneven,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class RubberState:
    """The sheet at one state.

    Attributes:
        strain: what happens to it.
        share: of that, 0…1.
        placed: the sheet that its material is in.
    """

    strain: Strain
    share: float
    placed: SheetState

    def points(self, material: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (…, 3) [m] of material points (…, 2) [m]."""
        return self.placed.points(self.strain(material, self.share))

    def material(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Places (n, 2) [m] of points (n, 3) [m]; of a flat sheet that is not stretched only."""
        return self.placed.material(points)


def state(strain: Strain, t: float) -> RubberState:
    """The sheet at a time [s]; flat and at rest in the beginning."""
    phase = 2 * np.pi * t / PERIOD_S
    turn = (0.05 * np.sin(phase / 2), 0.1 * np.sin(phase / 3), 0.0)
    placed = SheetState(float(np.deg2rad(40) * np.sin(phase)), turn, (0.02 * np.sin(phase / 2), 0.0, AWAY_M))
    return RubberState(strain, float(0.5 - 0.5 * np.cos(phase)), placed)


def printed_frames(
    strain: Strain, indices: Sequence[int], generator: np.random.Generator
) -> Iterator[tuple[SheetFrame, NDArray[np.uint8]]]:
    """Frames and their colour images (height, width, 3), of the same camera."""
    renderer, dense = Renderer(CAMERA, WALL, fineness=2), places(241, 161)
    noise = gaussian_filter(generator.standard_normal((*dense.shape[:2], 3)), (5, 5, 0))
    print_, nowhere = np.clip(128 + 60 * noise / noise.std(), 0, 255), np.zeros((CAMERA.height, CAMERA.width), np.bool_)
    for k in indices:
        now = state(strain, k * INTERVAL_S)
        view = renderer.render(Sheet(now.points(dense), np.full(dense.shape[:2], 0.6), print_))
        distance = view.distance + SIGMA * generator.standard_normal(view.distance.shape)
        picture = view.color + COLOR_SIGMA * generator.standard_normal(view.color.shape)
        frame = SheetFrame(round(k * INTERVAL_S * 1e9), distance.astype(np.float32), view.share > 0, nowhere, now)
        yield frame, np.clip(picture.round(), 0, 255).astype(np.uint8)
