"""Mistakes in the distances of a depth sensor: z taken as radial or the other way round, and a displaced depth image.

Both bend or tilt the boards that a sensor measures, which a pose far from the truth explains in part, with residuals
that look like noise. How large they are follows from one step of the solve with a column for each, beside another
scale and offset of the distances.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from calib.solve.bundle.additional_parameters import further
from calib.solve.bundle.blocks import Planes
from calib.solve.bundle.equations import Equations
from calib.solve.rounding import rounded
from calib.solve.solution import Solution

#: Mistakes are named from this many deviations on.
CERTAIN = 5.0

#: Exponent of the cosine by which distances are divided: 1 if z was taken as radial, -1 the other way round. Nearer
#: than this to one of these it is a mistake: what a camera measures wrongly is many times less, and what a depth image
#: of another place does is more.
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

    remedy: ClassVar[str] = "correct the geometry where they are imported or recorded"

    @property
    def finding(self) -> str:
        """The finding, without the sensor's name."""
        true, taken = ("z", "radial") if self.exponent > 0 else ("radial", "z")
        where = {"z": "z, along the optical axis", "radial": "radial, from the camera centre"}
        return f"its distances look like {where[true]}, and are taken as {taken}"

    def __str__(self) -> str:
        """The finding, and what to do."""
        return f"{self.sensor}: {self.finding}: {self.remedy}"


@dataclass(frozen=True)
class DistanceShift:
    """Distances that lie elsewhere in the image than the corners.

    Attributes:
        sensor: its name.
        shift, sigmas: of the distances from where they belong, and its deviations (2,) [px].
    """

    sensor: str
    shift: NDArray[np.float64]
    sigmas: NDArray[np.float64]

    remedy: ClassVar[str] = (
        "are the two of different cameras or modes, aligned wrongly, cropped or mirrored? Take both as the device "
        "makes them, or the depth image as a sensor of its own"
    )

    @property
    def finding(self) -> str:
        """The finding, without the sensor's name."""
        across, down = (
            f"{a:+.1f} ± {rounded(b)}" for a, b in zip(self.shift.tolist(), self.sigmas.tolist(), strict=True)
        )
        return f"its depth image is displaced by ({across}, {down}) px from the image that shows the corners"

    def __str__(self) -> str:
        """The finding, and what to do."""
        return f"{self.sensor}: {self.finding}: {self.remedy}"


def distance_errors(solution: Solution, needed_px: float) -> list[Misread | DistanceShift]:
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
) -> list[Misread | DistanceShift]:
    read, across, down, *terms = columns
    blocks = (np.stack([read, *terms], axis=1), np.stack([across, down, *terms], axis=1))
    every = further(solution.adjustment.equations, solution.adjustment.residuals, blocks)
    for block, one in zip(blocks, every, strict=False):  # of too few poses there are none
        count = block.shape[1] - len(terms)
        sizes, sigmas = one.sizes[:count], one.sigmas[:count]
        certain = np.abs(sizes) > CERTAIN * sigmas
        if count == 1 and certain.all() and abs(abs(sizes.item()) - 1) < MISREAD:
            return [Misread(sensor, sizes.item())]
        if count > 1 and np.any(certain & (np.abs(sizes) > needed_px)):
            return [DistanceShift(sensor, -sizes, sigmas)]
    return []


def _columns(equations: Equations, number: int, measured: Planes) -> Iterator[NDArray[np.float64]]:
    """Changes of all measured residuals (k,) by mistakes in one group's distances.

    They are divided by the cosine, or moved across and down by 1 px. Another offset and scale follow, unless they are
    solved anyway: what is too long everywhere is no mistake of these kinds.
    """
    group, start = equations.groups[number], np.zeros(equations.layout.size)
    before = equations.residuals(start)
    cosines = equations.base.sensors[group.sensor].camera.directions(measured.pixels)[:, 2]
    distances, solved = measured.distances, equations.layout.free_parameters[group.sensor].depth
    terms = {"depth_offset": distances + np.median(distances), "depth_scale": 2 * distances}
    changed = [
        # By the derivative at exponent 0, so that it is the same in both directions.
        replace(measured, distances=distances * (1 - np.log(cosines))),
        *(replace(measured, pixels=measured.pixels + step) for step in np.eye(2)),
        *(replace(measured, distances=other) for term, other in terms.items() if term not in solved),
    ]
    for one in changed:
        groups = [*equations.groups]
        groups[number] = replace(group, measured=one)
        change = (replace(equations, groups=groups).residuals(start) - before)[: equations.ends[-1]]
        # In a solution that is far off, a pixel beside one of them may have no direction.
        yield np.where(np.isfinite(change), change, 0.0)
