"""Estimates as ROS messages: mesh, vertices, theta, status."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from absmsg.v1.common_pb2 import Header

from abs_client.estimates.state import State, Status
from abs_client.ros2 import cdr, diagnostics

#: Red, green, blue of a mesh by status, 0 to 1. While TRACKING, the object's own colours count where they are known.
COLORS = {
    Status.TRACKING: (0.2, 0.7, 0.6),
    Status.DEGRADED: (0.95, 0.75, 0.1),
    Status.LOST: (0.85, 0.2, 0.2),
    Status.INITIALIZING: (0.6, 0.6, 0.6),
    Status.STALE: (0.6, 0.6, 0.6),
}
LEVELS = {
    Status.TRACKING: diagnostics.OK,
    Status.DEGRADED: diagnostics.WARN,
    Status.INITIALIZING: diagnostics.WARN,
    Status.LOST: diagnostics.ERROR,
    Status.STALE: diagnostics.STALE,
}

_TRIANGLE_LIST, _ADD, _DELETE = 11, 0, 2
_FLOAT32 = 7


def marker(state: State, rig: str, tracker: str) -> Any:
    """A visualization_msgs/Marker of the deformed faces [m]; without vertices, it deletes the last one."""
    corners = state.vertices[state.faces].reshape(-1, 3)
    known = state.status is Status.TRACKING and len(state.colors) > 0
    colors = state.colors[state.faces].reshape(-1, 3) / 255.0 if known else np.empty((0, 3))
    return cdr.make(
        "visualization_msgs/msg/Marker",
        header=cdr.header(state.message.header, rig),
        ns=tracker,
        id=0,
        type=_TRIANGLE_LIST,
        action=_ADD if len(corners) else _DELETE,
        pose=_pose(),
        scale=_vector(1.0, 1.0, 1.0),
        color=_color(*COLORS[state.status]),
        lifetime=cdr.make("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=[cdr.make("geometry_msgs/msg/Point", x=x, y=y, z=z) for x, y, z in corners.tolist()],
        colors=[_color(*rgb) for rgb in colors.tolist()],
        **_no_texture(),
    )


def vertices(state: State, rig: str) -> Any:
    """A sensor_msgs/PointCloud2 of the deformed vertices and their σ [m]: x, y, z, sigma; NaN if it is unknown."""
    data = np.column_stack([state.vertices, state.sigma]).astype("<f4")
    fields = [(name, 4 * number, _FLOAT32) for number, name in enumerate(("x", "y", "z", "sigma"))]
    return cdr.cloud(cdr.header(state.message.header, rig), fields, 16, data.tobytes())


def theta(state: State) -> Any:
    """A std_msgs/Float64MultiArray (2, dim): theta, then its standard deviations, which are NaN if they are unknown.

    The label of the rows is `theta, deviation; seq=N` with the estimate's number, that of the columns `model_id`.
    """
    size = len(state.theta)
    rows = (f"theta, deviation; seq={state.seq}", 2, 2 * size)
    columns = (state.message.model_id, size, size)
    dimensions = [
        cdr.make("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
        for label, size, stride in (rows, columns)
    ]
    layout = cdr.make("std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
    data = np.concatenate([state.theta, np.sqrt(np.diagonal(state.theta_covariance))])
    return cdr.make("std_msgs/msg/Float64MultiArray", layout=layout, data=data)


def status(state: State, rig: str, tracker: str) -> Any:
    """A diagnostic_msgs/DiagnosticArray: status, reasons, number, mesh, age and shares of the estimate."""
    values: Mapping[str, object] = {
        "status": state.status.value,
        "seq": state.seq,
        "mesh_version": state.mesh_version,
        "age_s": state.age_s,
        **{f"{name}_share": share for name, share in state.shares.items()},
    }
    said = "; ".join((state.status.value, *state.reasons))
    one = diagnostics.status(f"{rig}/{tracker}", rig, LEVELS[state.status], said, values)
    return diagnostics.array(cdr.header(state.message.header, rig), [one])


def _pose() -> Any:
    orientation = cdr.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return cdr.make(
        "geometry_msgs/msg/Pose",
        position=cdr.make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0),
        orientation=orientation,
    )


def _vector(x: float, y: float, z: float) -> Any:
    return cdr.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def _color(r: float, g: float, b: float) -> Any:
    return cdr.make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=1.0)


def _no_texture() -> dict[str, Any]:
    nothing = np.empty(0, np.uint8)
    empty = cdr.header(Header(), "")
    return {
        "texture_resource": "",
        "texture": cdr.make("sensor_msgs/msg/CompressedImage", header=empty, format="", data=nothing),
        "uv_coordinates": [],
        "text": "",
        "mesh_resource": "",
        "mesh_file": cdr.make("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        "mesh_use_embedded_materials": False,
    }
