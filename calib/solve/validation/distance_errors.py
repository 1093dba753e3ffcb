"""Mistakes in the distances of a depth sensor: z taken as radial or the other way round, and a displaced depth image.

Both bend or tilt the boards that a sensor measures, which a pose far from the truth explains in part, with residuals
that look like noise. How large they are follows from one step of the solve with a column for each.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.blocks import Planes
from calib.solve.bundle.equations import Equations
from calib.solve.bundle.further import further
from calib.solve.solution import Solution

#: Mistakes are named from this many deviations on.
CERTAIN = 5.0

#: Exponent of the cosine by which distances are divided: 1 if z was taken as radial, -1 the other way round. Nearer to
#: these than to 0 it is a mistake: what a camera measures wrongly is many times less.
MISREAD = 0.5


@dataclass(frozen=True)
class Misread:
    """Distances along the optical axis that were taken as radial, or the other way round.

    Attributes:
        sensor: its name.
        exponent: of the cosine between ray and optical axis, by which the distances have to be divided.
    """

    sensor: str
    exponent: float

    def __str__(self) -> str:
        """The finding, and what to do."""
        true, taken = ("z", "radial") if self.exponent > 0 else ("radial", "z")
        where = {"z": "z, along the optical axis", "radial": "radial, from the camera centre"}
        return (
            f"{self.sensor}: its distances look like {where[true]}, and are taken as {taken}: correct the geometry "
            "where they are imported or recorded"
        )


@dataclass(frozen=True)
class Displaced:
    """Distances that lie elsewhere in the image than the corners.

    Attributes:
        sensor: its name.
        shift, sigmas: of the distances from where they belong, and its deviations (2,) [px].
    """

    sensor: str
    shift: NDArray[np.float64]
    sigmas: NDArray[np.float64]

    def __str__(self) -> str:
        """The finding, and what to do."""
        across, down = (f"{a:+.1f} ± {b:.1g}" for a, b in zip(self.shift.tolist(), self.sigmas.tolist(), strict=True))
        return (
            f"{self.sensor}: its depth image is displaced by ({across}, {down}) px from the image that shows the "
            "corners: are they of two cameras or modes, aligned wrongly, or cropped? Take both as the device makes "
            "them, or the depth image as a sensor of its own"
        )


def distance_errors(solution: Solution, needed_px: float) -> list[Misread | Displaced]:
    """Mistakes in distances, at most one of each sensor, that are certain and matter.

    Args:
        solution: from all shots.
        needed_px: required accuracy of projections [px], beyond which a displaced image matters.
    """
    found = []
    for number, group in enumerate(solution.adjustment.equations.groups):
        if isinstance(group.measured, Planes):
            sensor = group.sensor
            # Of a sensor that makes no image and may stand anywhere, a displaced image is another direction.
            is_placed = solution.task.sensors[sensor].fixed_pose or any(
                view.sensor == sensor for view in solution.task.corners
            )
            columns = [*_columns(solution.adjustment.equations, number, group.measured)]
            found += _of_group(solution, sensor, columns, needed_px if is_placed else np.inf)
    return found


def _of_group(
    solution: Solution, sensor: str, columns: Sequence[NDArray[np.float64]], needed_px: float
) -> list[Misread | Displaced]:
    read, *moved = columns
    of_both = (read[:, None], np.stack(moved, axis=1))
    for one in further(solution.adjustment.equations, solution.adjustment.residuals, of_both):
        is_read = len(one.sizes) == 1
        if np.any(np.abs(one.sizes) > np.maximum(MISREAD if is_read else needed_px, CERTAIN * one.sigmas)):
            return [Misread(sensor, one.sizes.item()) if is_read else Displaced(sensor, -one.sizes, one.sigmas)]
    return []


def _columns(equations: Equations, number: int, measured: Planes) -> Iterator[NDArray[np.float64]]:
    """Changes of all measured residuals (k,) if one group's distances are divided by the cosine, or moved by 1 px."""
    group, start = equations.groups[number], np.zeros(equations.layout.size)
    before = equations.residuals(start)
    cosines = equations.base.sensors[group.sensor].camera.directions(measured.pixels)[:, 2]
    # By the derivative at exponent 0, so that it is the same in both directions.
    read = replace(measured, distances=measured.distances * (1 - np.log(cosines)))
    moved = [replace(measured, pixels=measured.pixels + step) for step in np.eye(2)]
    for changed in (read, *moved):
        groups = [*equations.groups]
        groups[number] = replace(group, measured=changed)
        yield (replace(equations, groups=groups).residuals(start) - before)[: equations.ends[-1]]
