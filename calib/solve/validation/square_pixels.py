"""Cameras whose pixels would not be square: signs of an uneven print, of resized images, or of motion during a readout.

A board that moves along the columns, or a camera that turns, while a rolling shutter reads the rows makes boards longer
or shorter in each image, and all poses agree about it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.solve.rounding import rounded
from calib.solve.solution import Solution
from calib.solve.validation.board_shape import effect_px

#: Pixels of sensors are square to half a percent. From the larger one on, images are meant to be stretched, as those of
#: anamorphic video or of single fields are.
SQUARE, MEANT = 0.005, 0.06

#: Pixels that would not be square are doubted if projections change by this share of what is needed; 95 % of the
#: changes are then below what is needed.
NOTICED = 0.58

#: Changes of projections that are worth a word [px].
_WORTH_PX = 0.1

#: Deviations from which on a ratio is certain.
CERTAIN = 4.0


@dataclass(frozen=True)
class NotSquare:
    """Pixels of a sensor that are certainly not square, and not meant to be otherwise.

    Attributes:
        ratio, sigma: logarithm of the ratio of the focal lengths, fy / fx, and its standard deviation.
        effect_px: how much projections change if the pixels are square, root mean square [px].
    """

    ratio: float
    sigma: float
    effect_px: float

    @property
    def shape(self) -> str:
        """The pixels, in words."""
        return "wider than high" if self.ratio > 0 else "higher than wide"


def not_square(solution: Solution, distance: float) -> dict[str, NotSquare]:
    """Sensors with a free ratio of focal lengths that is not 1; a given camera with the same ratio dispels the doubt.

    Args:
        solution: from all shots.
        distance: of the scene [m].
    """
    layout, found = solution.adjustment.layout, {}
    for name, own in layout.free_parameters.items():
        if not {"fx", "fy"} <= {*own.intrinsics}:
            continue
        camera, given = solution.cameras[name], solution.task.sensors[name].factory
        columns = layout.columns(name, ["fx", "fy"])
        slope = np.array([-1 / camera.fx, 1 / camera.fy])
        covariances = solution.covariance[:, columns] @ slope  # of all parameters with the ratio
        variance = float(covariances[columns] @ slope)
        ratio = float(np.log(camera.fy / camera.fx))
        as_given = any(abs(ratio - np.log(each.fy / each.fx)) < SQUARE for each in given)
        if CERTAIN * np.sqrt(variance) < abs(ratio) < MEANT and not as_given:
            effect = effect_px(solution, -covariances / variance * ratio, distance)
            found[name] = NotSquare(ratio, float(np.sqrt(variance)), effect)
    return found


def doubts(found: Mapping[str, NotSquare], needed_px: float) -> list[str]:
    """Doubts about sensors whose pixels are far from square, where that matters for an accuracy of projections [px]."""
    return [
        f"{name}: its pixels would be {abs(one.ratio):.1%} ± {one.sigma:.1%} {one.shape}, and those of sensors are "
        "square: did the printer scale along one axis, were images resized, or did board or camera move while the rows "
        "were read? Measure rows and columns of the board with a ruler, and hold it still; if the pixels are so, give "
        "a camera that has them with --start"
        for name, one in found.items()
        if abs(one.ratio) > SQUARE and one.effect_px > NOTICED * needed_px
    ]


def remarks(found: Mapping[str, NotSquare]) -> str:
    """Sentences on pixels that may be square, and what that would change; "" where it is not worth a word."""
    return "".join(
        f" If pixels of {name} are square, projections change by up to {rounded(one.effect_px)} px: they would be "
        f"{abs(one.ratio):.2%} {one.shape}."
        for name, one in found.items()
        if one.effect_px > _WORTH_PX
    )
