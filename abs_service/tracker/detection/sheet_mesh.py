"""A flat rectangular sheet and its mesh."""

from dataclasses import dataclass, replace

import numpy as np

from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.mesh import Mesh
from calib import pose
from calib.pose import Pose


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat rectangle.

    Attributes:
        T_rp: pose that maps the plane of the sheet to the rig: origin in its centre, x along its long side, y along its
            short side, z away from the sensor.
        width, height: long and short side [m].
    """

    T_rp: Pose
    width: float
    height: float

    def of_size(self, width: float, height: float, tolerance: float) -> "Sheet":
        """The same sheet with known sides [m].

        Raises:
            DetectionError: the relative difference of a detected side from the known one exceeds `tolerance`.
        """
        long, short = max(width, height), min(width, height)
        if max(abs(self.width / long - 1), abs(self.height / short - 1)) > tolerance:
            raise DetectionError(
                f"the rectangle in sight is {self.width:.3f} m × {self.height:.3f} m, which differs by more than "
                f"{tolerance:.0%} from width_m × height_m = {long:g} m × {short:g} m"
            )
        return replace(self, width=long, height=short)

    def mesh(self, vertices: int) -> Mesh:
        """A regular grid of about `vertices` vertices without colours, oriented towards the sensor.

        The outer vertices lie half a cell inside the rim, because pixels at the rim mix sheet and background.
        """
        columns = max(2, round(np.sqrt(vertices * self.width / self.height)))
        rows = max(2, round(vertices / columns))
        chart = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
        flat = ((chart + 0.5) / (columns, rows) - 0.5) * (self.width, self.height)
        positions = pose.transform(self.T_rp, np.column_stack([flat, np.zeros(len(flat))]))
        faces = triangles(np.arange(rows * columns).reshape(rows, columns)).astype(np.int32)
        return Mesh(positions, faces, np.full((len(flat), 3), np.nan, np.float32), chart)
