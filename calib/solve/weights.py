"""Deviations of corners before anything is known of the lens."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.views import CornerView


def shared(views: Sequence[CornerView]) -> list[CornerView]:
    """The views with one deviation for all of a sensor: the median of theirs.

    What a view's corners scatter about a regular board is noise and distortion of the lens together, so that views at
    the border of the image, which say most about the lens, would count least. How large the noise really is, the solve
    finds from its residuals, for each sensor.
    """
    sigmas: dict[str, list[float]] = {}
    for view in views:
        sigmas.setdefault(view.sensor, []).append(view.sigma_px)
    return [replace(view, sigma_px=float(np.median(sigmas[view.sensor]))) for view in views]
