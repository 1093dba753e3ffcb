"""A flat rectangular sheet and its mesh."""

from dataclasses import dataclass, replace

import numpy as np

from abs_service.tracker.detection.grid_mesh import triangles
from abs_service.tracker.detection.initial_detection import DetectionError
from abs_service.tracker.detection.shapes.principal_axes import principal_axes
from abs_service.tracker.mesh import Mesh
from calib import pose
from calib.pose import Pose

#: A mesh is flat if its thickness is at most this share of its long side, and a rectangle if its area is at least this
#: share of that of the rectangle around it.
FLAT, MIN_AREA = 0.005, 0.98


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat rectangle.

    Attributes:
        T_rp: pose that maps the plane of the sheet to the rig: origin in its centre, x along its long side, y along its
            short side, z away from the sensor.
        width, height: long and short side [m].
        is_known: True if they are known, False if they were found in an image.
    """

    T_rp: Pose
    width: float
    height: float
    is_known: bool = False

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

        The outer vertices of a sheet that was found in an image lie half a cell inside its rim, because pixels at the
        rim mix sheet and background; those of a known one on the rim.
        """
        columns = max(2, round(np.sqrt(vertices * self.width / self.height)))
        rows = max(2, round(vertices / columns))
        chart = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2).astype(np.float64)
        inset = 0.0 if self.is_known else 0.5
        cells = np.array([columns, rows]) - 1 + 2 * inset
        flat = ((chart + inset) / cells - 0.5) * (self.width, self.height)
        positions = pose.transform(self.T_rp, np.column_stack([flat, np.zeros(len(flat))]))
        faces = triangles(np.arange(rows * columns).reshape(rows, columns)).astype(np.int32)
        unknown = np.full((len(flat), 3), np.nan, np.float32)
        return Mesh(positions, faces, unknown, chart, is_complete=self.is_known)


def rectangle_of(mesh: Mesh) -> Sheet | None:
    """The flat rectangle that a mesh covers, its z axis against the normals of the mesh; None if it is none."""
    center, axes = principal_axes(mesh.vertices)
    width, height, thickness = np.ptp((mesh.vertices - center) @ axes, axis=0).tolist()
    if thickness > FLAT * width or mesh.area < MIN_AREA * width * height:
        return None
    z = -np.sign(axes[:, 2] @ mesh.normals.sum(axis=0)) * axes[:, 2]
    T_rp = np.eye(4)
    T_rp[:3] = np.column_stack([axes[:, 0], np.cross(z, axes[:, 0]), z, center])
    return Sheet(T_rp, width, height, is_known=True)
