"""Errors that the corners of a view have in common, as on a board that is bent by the hand that holds it."""

from dataclasses import replace

import numpy as np

from calib.board.views import CornerView


def bent(view: CornerView, amplitude_px: float, generator: np.random.Generator) -> CornerView:
    """View with a smooth random displacement of some tenths of `amplitude_px` [px]."""
    x, y, _ = (view.points_b / np.ptp(view.points_b, axis=0).max() - 0.5).T
    shapes = np.stack([x * y, x**2, y**2, x**3, y**3])
    return replace(view, pixels=view.pixels + (generator.normal(0, amplitude_px, (2, 5)) @ shapes).T)
