"""Cameras whose pixels would not be square: signs of an uneven print, of resized images, or of motion during a readout.

A board that moves along the columns while a rolling shutter reads the rows becomes longer or shorter in each image, and
all its poses agree about it.
"""

import numpy as np

from calib.solve.solution import Solution

#: Pixels of sensors are square to half a percent. From the larger one on, images are meant to be stretched, as those of
#: anamorphic video or of single fields are.
SQUARE, MEANT = 0.01, 0.06

#: Deviations from which on a ratio is certain.
CERTAIN = 4.0


def not_square(solution: Solution) -> list[str]:
    """Doubts about sensors with a free ratio of focal lengths; a given camera with the same ratio dispels them."""
    layout, found = solution.adjustment.layout, []
    for name, own in layout.free_parameters.items():
        if not {"fx", "fy"} <= {*own.intrinsics}:
            continue
        camera, given = solution.cameras[name], solution.task.sensors[name].factory
        columns = layout.columns(name, ["fx", "fy"])
        slope = np.array([-1 / camera.fx, 1 / camera.fy])
        sigma = float(np.sqrt(slope @ solution.covariance[np.ix_(columns, columns)] @ slope))
        ratio = float(np.log(camera.fy / camera.fx))
        as_given = any(abs(ratio - np.log(each.fy / each.fx)) < SQUARE for each in given)
        if max(SQUARE, CERTAIN * sigma) < abs(ratio) < MEANT and not as_given:
            found.append(_said(name, ratio, sigma))
    return found


def _said(name: str, ratio: float, sigma: float) -> str:
    shape = "wider than high" if ratio > 0 else "higher than wide"
    return (
        f"{name}: its pixels would be {abs(ratio):.1%} ± {sigma:.1%} {shape}, and those of sensors are square: did the "
        "printer scale along one axis, were images resized, or did board or camera move while the rows were read? "
        "Measure rows and columns of the board with a ruler, and hold it still; if the pixels are so, give a camera "
        "that has them with --start"
    )
