"""A flat rectangular sheet of known size."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from abs_service.tracker.detection.shapes.samples import Samples, farthest_first
from abs_service.tracker.detection.shapes.sheet_mesh import Sheet
from abs_service.tracker.detection.templates.known_object import KnownObject
from calib import pose

Side = Annotated[float, Interval(gt=0, le=20)]

#: Number of sample points for the registration; more are slower but not more accurate.
SAMPLES = 1500


@dataclass(frozen=True)
class Settings:
    """TOML keys of the template.

    Attributes:
        size: lengths of the sheet's sides [m], in any order.
    """

    size: tuple[Side, Side]

    def build(self, vertices: int) -> KnownObject:
        """The sheet with a grid of about `vertices` vertices, the outermost ones on its rim."""
        long, short = max(self.size), min(self.size)
        sheet = Sheet(pose.identity(), long, short, is_known=True)
        fine = sheet.mesh(SAMPLES).vertices
        points = fine[farthest_first(fine, len(fine))]
        normals = np.tile((0.0, 0.0, -1.0), (len(points), 1))
        return KnownObject(sheet.mesh(vertices), Samples(points, normals, long * short, is_closed=False))
