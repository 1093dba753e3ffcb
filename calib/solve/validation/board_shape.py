"""Shape of the printed board: errors that all views share, which small residuals and agreeing halves do not show.

A print that is longer along one axis or skewed, tags of another size than described, or a bent board are explained by
wrong intrinsics instead. How large such an error is follows from one Gauss-Newton step with its column added to the
equations, its deviation from the scatter of the distinct poses (a sandwich estimator, as in
`calib.solve.bundle.uncertainty`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.additional_parameters import further
from calib.solve.bundle.bent_boards import curves, shape_columns
from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.validation import projection_uncertainty
from calib.solve.validation.support import supported

#: Errors are named from this many deviations on, and an uneven print, for which there are six of them and which other
#: mistakes reach with 5.8, from more, …
CERTAIN, CERTAIN_UNEVEN = 5.0, 8.0

#: … and if they change projections by this share of what is needed; a bend or skew, which a lens that fits nearly and a
#: motion imitate, by more.
NOTICED, NOTICED_BEND = 0.15, 0.25

#: Tags are named from this size on [%] in any case: if it is their gaps, all lengths are wrong by as much, and no lens.
_NOTICED_TAGS = 0.5

#: Size of the errors of lengths that columns of the equations stand for.
_SHARE = 0.01


#: Powers of x and y of points that are displaced within the plane of the board, along each of its axes.
_UNEVEN = ((2, 0), (1, 1), (0, 2))

#: Powers of x and y of the bends, even and odd ones; the latter leave fewer traces in the image of a narrow lens.
_POWERS = ((2, 0), (0, 2), (1, 1), (3, 0), (2, 1), (1, 2), (0, 3))


class Shape(Enum):
    """Kinds of errors, each with what to do."""

    STRETCH = "measure rows and columns with a ruler, and print without scaling"
    SKEW = (
        "measure both diagonals with a ruler, and print anew if they differ; otherwise the board was carried along "
        "while a rolling shutter read the rows: hold it still"
    )
    TAGS = "measure a tag and a gap with a ruler, and correct the description"
    UNEVEN = "measure the outermost squares of all four sides with a ruler, and print anew"
    BEND = "glue it onto a flat plate"


@dataclass(frozen=True)
class ShapeError:
    """An error of the board's shape.

    Attributes:
        shape: length along x relative to y [%], the angle between rows and columns beyond a right one [% of a radian],
            size of the tags relative to the distances of their centres [%], or how far points of the edge are displaced
            from the middle on, by squares of x and y, within the board or out of it (a bend, also by cubes) [mm].
        size, sigma: its estimate and standard deviation.
        effect_px: how much projections change if it is taken into account, root mean square, at the distance of the
            scene or those of the boards where that is most [px].
    """

    shape: Shape
    size: float
    sigma: float
    effect_px: float

    @property
    def is_misprint(self) -> bool:
        """True if the print is not as described, False if it is not flat."""
        return self.shape != Shape.BEND

    @property
    def is_bend(self) -> bool:
        """True if the board is not flat."""
        return self.shape == Shape.BEND

    @property
    def certainty(self) -> float:
        """Size in standard deviations."""
        return abs(self.size) / self.sigma

    @property
    def finding(self) -> str:
        """One clause for people."""
        size = f"{abs(self.size):.2f} ± {self.sigma:.2f} %"
        effect = f"projections by up to {rounded(self.effect_px)} px"
        bend = f"{rounded(abs(self.size))} ± {rounded(self.sigma, 1)} mm"
        match self.shape:
            case Shape.STRETCH:
                longer, other = ("rows", "columns") if self.size > 0 else ("columns", "rows")
                found = f"the board's {longer} are {size} longer than described, compared with its {other}"
            case Shape.SKEW:
                angle = f"{np.degrees(abs(self.size) / 100):.2f}° ± {np.degrees(self.sigma / 100):.2f}°"
                found = f"the board's rows and columns are {angle} from a right angle"
            case Shape.TAGS:
                than = "larger" if self.size > 0 else "smaller"
                found = f"tags are {size} {than} than described, compared with their distances"
                effect += ", and all lengths by as many per cent if the gaps are not as described"
            case Shape.UNEVEN:
                found = f"the print is uneven: from its middle to its edges points are displaced by {bend}"
            case Shape.BEND:
                return f"a board that is bent by {bend} would explain what the corners miss by, and change {effect}"
        return f"{found}, which changes {effect}"

    def __str__(self) -> str:
        """The finding, and what to do."""
        return f"{self.finding}: {self.shape.value}"

    def matters(self, needed_px: float) -> bool:
        """True if projections, required to be accurate to `needed_px` [px], or lengths are wrong by too much."""
        if self.shape == Shape.TAGS and abs(self.size) > _NOTICED_TAGS:
            return True
        noticed = NOTICED if self.shape in (Shape.STRETCH, Shape.TAGS) else NOTICED_BEND
        return self.effect_px > noticed * needed_px


def shape_errors(solution: Solution, distance: float, needed_px: float) -> list[ShapeError]:
    """Errors of the board that are certain and matter: the surest of the print, the bend with the largest effect.

    Args:
        solution: from all shots.
        distance: of the scene [m].
        needed_px: required accuracy of projections [px].
    """
    found = [
        one
        for one in _estimates(solution, distance)
        if abs(one.size) > (CERTAIN_UNEVEN if one.shape == Shape.UNEVEN else CERTAIN) * one.sigma
        and one.matters(needed_px)
    ]
    misprints = sorted((one for one in found if one.is_misprint), key=lambda one: -one.certainty)
    bends = sorted((one for one in found if not one.is_misprint), key=lambda one: -one.effect_px)
    return [*misprints[:1], *bends[:1]]


def _estimates(solution: Solution, distance: float) -> Iterator[ShapeError]:
    equations = solution.adjustment.equations
    jacobian = equations.base_jacobian
    columns, bent = shape_columns(equations, jacobian, _displacements), shape_columns(equations, jacobian, bends)
    shapes = (Shape.STRETCH, Shape.SKEW, Shape.TAGS, *(Shape.UNEVEN,) * 2 * len(_UNEVEN), *(Shape.BEND,) * len(_POWERS))
    # A bend looks uneven where boards are tilted alike.
    beside = [bent if shape == Shape.UNEVEN else bent[:, :0] for shape in shapes]
    given = [np.column_stack(each) for each in zip([*columns.T, *bent.T], beside, strict=True)]
    for shape, one in zip(shapes, further(equations, solution.adjustment.residuals, given), strict=False):
        # Of too few poses there are none.
        yield ShapeError(shape, float(one.sizes[0]), float(one.sigmas[0]), effect_px(solution, one.changes, distance))


def _displacements(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements of points of the board (n, 3) within its plane, for each error of the print (n, 9, 3) [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    x, y, _ = (points - (low + high) / 2).T
    none = np.zeros_like(x)
    stretch = np.stack([x, -y, none], axis=1) * _SHARE / 2
    skew = np.stack([y, x, none], axis=1) * _SHARE / 2
    tags = np.stack([_from_tag(points[:, 0]), _from_tag(points[:, 1]), none], axis=1) * _SHARE
    along = curves(points, _UNEVEN)[:, :, None]
    return np.concatenate([np.stack([stretch, skew, tags], axis=1), along * np.eye(3)[0], along * np.eye(3)[1]], axis=1)


def bends(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements of points of the board (n, 3) in its frame, for each bend (n, 7, 3) [m]."""
    return curves(points, _POWERS)[:, :, None] * np.eye(3)[2]


def _from_tag(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of points along an axis from the middle of their tag (n,) [m]; 0 if points are evenly spaced.

    Gaps are narrower than tags.
    """
    edges, numbers = np.unique(places, return_inverse=True)
    steps = np.diff(edges)
    if len(steps) == 0 or np.ptp(steps) < _SHARE * steps.max():
        return np.zeros_like(places)
    before, after = np.concatenate([[0.0], steps]), np.concatenate([steps, [0.0]])
    return np.where(after > before, -after, before)[numbers] / 2


def effect_px(solution: Solution, changes: NDArray[np.float64], distance: float) -> float:
    """Largest change of a sensor's projections [px] by changes of all parameters (n,), up to a motion of it.

    Counted at the ends of the boards' distances, too: in their middle, a motion makes up for most of a bend.
    """
    layout, found = solution.adjustment.layout, [0.0]
    for name, free in layout.free_parameters.items():
        if free.intrinsics:
            pixels = projection_uncertainty.grid(solution.cameras[name]).reshape(-1, 2)
            usable = supported(solution, name, pixels)
            for each in (distance, *projection_uncertainty.reach(solution, name)):
                jacobian = projection_uncertainty.implied_jacobian(solution, name, each)
                moved = np.linalg.norm(jacobian @ changes[layout.columns(name, free.intrinsics)], axis=1)
                found.append(projection_uncertainty.rms(moved[usable]))
    return float(np.nanmax(found))
