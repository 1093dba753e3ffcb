"""Messages for viewers: the deformed mesh as triangles, depth images as points."""

import numpy as np
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.TriangleListPrimitive_pb2 import TriangleListPrimitive
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from numpy.typing import NDArray

from abs_service.bus import keys
from abs_service.wire.estimate_messages import State

#: Red, green, blue of a mesh by status, 0 to 1. While TRACKING, the object's own colours count where they are known.
COLORS = {
    State.STATUS_UNSPECIFIED: (0.6, 0.6, 0.6),
    State.STATUS_INITIALIZING: (0.6, 0.6, 0.6),
    State.STATUS_TRACKING: (0.2, 0.7, 0.6),
    State.STATUS_DEGRADED: (0.95, 0.75, 0.1),
    State.STATUS_LOST: (0.85, 0.2, 0.2),
}


class ViewRate:
    """Decides which messages a viewer gets: of each period of 1 / `hz`, the first one.

    Args:
        hz: largest rate [Hz]; 0 for none.
    """

    def __init__(self, hz: float):
        self._hz = hz
        self._period = -1

    def due(self, t_ns: int) -> bool:
        """True if the message of time `t_ns` is the first of its period."""
        period = int(t_ns * self._hz * 1e-9) if self._hz else self._period
        is_due, self._period = period != self._period, period
        return is_due


def scene_update(mesh: DeformedMesh, topology: MeshTopology, status: State.Status) -> SceneUpdate:
    """A mesh as one entity, which replaces the tracker's last one; without vertices, that one is deleted.

    Args:
        mesh: the deformed vertices.
        topology: of the same version.
        status: of the estimate; tells the colour, see `COLORS`.
    """
    stamp = mesh.header.stamp
    if not mesh.vertices_f32:
        deletion = SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletion.MATCHING_ID, id=mesh.tracker)
        return SceneUpdate(deletions=[deletion])
    vertices = np.frombuffer(mesh.vertices_f32, "<f4").reshape(-1, 3)
    colors = topology.colors_u8 if status == State.STATUS_TRACKING else b""
    red, green, blue = COLORS[status]
    triangles = TriangleListPrimitive(
        pose=_origin(),
        points=[Point3(x=x, y=y, z=z) for x, y, z in vertices.tolist()],
        color=Color(r=red, g=green, b=blue, a=1.0),
        colors=[Color(r=r, g=g, b=b, a=1.0) for r, g, b in (np.frombuffer(colors, "u1").reshape(-1, 3) / 255).tolist()],
        indices=np.frombuffer(topology.faces_u32, "<u4").tolist(),
    )
    entity = SceneEntity(timestamp=stamp, frame_id=keys.RIG_FRAME, id=mesh.tracker, triangles=[triangles])
    return SceneUpdate(entities=[entity])


def point_cloud(sensor: str, wall_ns: int, points: NDArray[np.float32]) -> PointCloud:
    """Points (…, 3) [m] in the frame of a sensor, without those that are NaN.

    Args:
        sensor: its name, which is also that of its frame.
        wall_ns: wall-clock time of the exposure [ns].
        points: the points.
    """
    known = points[np.isfinite(points[..., 2])]
    fields = [
        PackedElementField(name=name, offset=4 * number, type=PackedElementField.FLOAT32)
        for number, name in enumerate("xyz")
    ]
    cloud = PointCloud(
        frame_id=sensor,
        pose=_origin(),
        point_stride=12,
        fields=fields,
        data=known.astype("<f4").tobytes(),
    )
    cloud.timestamp.FromNanoseconds(wall_ns)
    return cloud


def _origin() -> Pose:
    return Pose(position=Vector3(), orientation=Quaternion(w=1.0))
