"""A flat rectangular sheet of known size."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.detection.known_object import KnownObject
from abs_service.tracker.detection.samples import Samples, farthest_first
from abs_service.tracker.mesh import Mesh

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
        fine = grid(long, short, SAMPLES).vertices
        points = fine[farthest_first(fine, len(fine))]
        normals, unknown = np.tile((0.0, 0.0, -1.0), (len(points), 1)), np.full_like(points, np.nan)
        return KnownObject(
            grid(long, short, vertices), Samples(points, normals, unknown, long * short, is_closed=False)
        )


def grid(width: float, height: float, vertices: int) -> Mesh:
    """A regular grid over a rectangle [m] at z = 0 around the origin; x along its width, normals towards −z."""
    columns = max(2, round(np.sqrt(vertices * width / height)))
    rows = max(2, round(vertices / columns))
    chart = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
    flat = (chart / (columns - 1, rows - 1) - 0.5) * (width, height)
    faces = triangles(np.arange(rows * columns).reshape(rows, columns)).astype(np.int32)
    positions = np.column_stack([flat, np.zeros(len(flat))])
    return Mesh(positions, faces, np.full((len(flat), 3), np.nan, np.float32), chart, is_complete=True)
