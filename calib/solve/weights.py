"""Deviations of corners for the initial optimisation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.board.views import CornerView


def shared(views: Sequence[CornerView]) -> list[CornerView]:
    """Views with a common deviation per sensor: the median of theirs.

    A view's scatter about a regular board contains noise and lens distortion, so that views at the border of the image,
    which are the most informative about the lens, would get the lowest weight. The actual noise of each sensor is
    estimated from the residuals.
    """
    sigmas: dict[str, list[float]] = {}
    for view in views:
        sigmas.setdefault(view.sensor, []).append(view.sigma_px)
    return [replace(view, sigma_px=float(np.median(sigmas[view.sensor]))) for view in views]
