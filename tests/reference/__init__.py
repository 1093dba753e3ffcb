"""The equations of the method as plain, slow NumPy: one vertex at a time, as the paper writes them.

Numbers in parentheses are the paper's equations. The service uses nothing of this; tests compare the two.
"""

from tests.reference.cameras import bend, distance, distance_at_center, distort, distort_fisheye, project, seen_pixel
from tests.reference.likelihood import (
    ChannelNoise,
    channel_cost,
    color_cost,
    depth_cost,
    lambert,
    meeting_point,
    picture_deviation,
    rim_cost,
    stretch_cost,
)
from tests.reference.models import (
    base_spline,
    base_spline_slope,
    deform,
    flexpad,
    flexpad_normal,
    gravity,
    gravity_segment,
    knots,
    rational_basis,
    surface,
    surface_normal,
)
from tests.reference.warping import warped

__all__ = [
    "ChannelNoise",
    "base_spline",
    "base_spline_slope",
    "bend",
    "channel_cost",
    "color_cost",
    "deform",
    "depth_cost",
    "distance",
    "distance_at_center",
    "distort",
    "distort_fisheye",
    "flexpad",
    "flexpad_normal",
    "gravity",
    "gravity_segment",
    "knots",
    "lambert",
    "meeting_point",
    "picture_deviation",
    "project",
    "rational_basis",
    "rim_cost",
    "seen_pixel",
    "stretch_cost",
    "surface",
    "surface_normal",
    "warped",
]
