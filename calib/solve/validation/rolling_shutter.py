"""Boards that moved alike in all images while a rolling shutter read them.

Each row, or column of an image that was turned, shows the board where it was then. Boards that always sink, come nearer
or are carried to one side shear and stretch in all images alike, by more the nearer they are: poses and intrinsics
explain most of it, so that neither residuals nor halves show it. One step of the solve with a motion added says how
large it is, beside a bend of the board, which looks like it in part.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.additional_parameters import further
from calib.solve.bundle.bent_boards import ByPlaces, by_places, shape_columns
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.validation.board_shape import CERTAIN, bends, effect_px

#: Motions that change projections by this share of what is needed matter.
NOTICED = 0.25

#: Size of the motions that columns of the equations stand for [m].
_MOVED_M = 1e-3


@dataclass(frozen=True)
class Motion:
    """A motion that a sensor's images have in common.

    Attributes:
        sensor: its name.
        size, sigma: of the motion while one image is read, and its standard deviation [mm].
        effect_px: how much projections change if it is taken into account, root mean square [px].
    """

    sensor: str
    size: float
    sigma: float
    effect_px: float

    is_bend: ClassVar[bool] = False

    @property
    def certainty(self) -> float:
        """Size in standard deviations."""
        return abs(self.size) / self.sigma

    def __str__(self) -> str:
        """The finding, and what to do."""
        return (
            f"{self.sensor}: its images look as if board or camera moved by {rounded(abs(self.size))} ± "
            f"{rounded(self.sigma, 1)} mm in the same way while each was read, row by row, which changes projections "
            f"by up to {rounded(self.effect_px)} px: hold both still in each shot"
        )


def motions(solution: Solution, distance: float) -> list[Motion]:
    """The surest motion of those that are certain, if any; smaller effects make projections known worse.

    Args:
        solution: from all shots.
        distance: of the scene [m].
    """
    found = [one for one in _estimates(solution, distance) if one.certainty > CERTAIN]
    return sorted(found, key=lambda one: -one.certainty)[:1]


def noticed(found: Sequence[Motion], needed_px: float) -> list[Motion]:
    """Motions that matter where projections are needed to `needed_px` [px]."""
    return [one for one in found if one.effect_px > NOTICED * needed_px]


def _estimates(solution: Solution, distance: float) -> Iterator[Motion]:
    equations = solution.adjustment.equations
    jacobian = equations.base_jacobian
    bent = shape_columns(equations, jacobian, bends)
    columns = [
        (each.sensor, np.hstack([_whole(each, moved, len(bent)), bent]))
        for each in by_places(equations, jacobian)
        for moved in _moved(solution, each).T
    ]
    every = further(equations, solution.adjustment.residuals, [given for _, given in columns])
    for (name, _), one in zip(columns, every, strict=False):  # of too few poses there are none
        if one.sigmas[0] > 0:  # and of a sensor that nothing is estimated of
            yield Motion(name, float(one.sizes[0]), float(one.sigmas[0]), effect_px(solution, one.changes, distance))


def _moved(solution: Solution, given: ByPlaces) -> NDArray[np.float64]:
    """Derivatives of residuals with respect to motions along x, y and z during the rows, and the columns (n, 6)."""
    camera = solution.cameras[given.sensor]
    along = given.by_place @ camera.T_rs[:3, :3] * _MOVED_M
    times = given.corners.pixels / (camera.width, camera.height) - 0.5
    return np.hstack([along * np.repeat(times[:, axis], 2)[:, None] for axis in (1, 0)])


def _whole(given: ByPlaces, column: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Column (count, 1) of all residuals, 0 for those of others."""
    found = np.zeros((count, 1))
    found[given.rows, 0] = column
    return found
