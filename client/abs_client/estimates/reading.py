"""The messages of an estimate, checked where they arrive: later, a broken array would end the reader's loop."""

import numpy as np
from absmsg.v1.deformation_state_pb2 import CompactState, DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from abs_client.connection.received import Received, decoded
from abs_client.errors import MalformedError

#: Bytes of a vertex, a face, a vertex' covariance and its colour; of a number.
VERTEX, FACE, COVARIANCE, COLOR, NUMBER = 12, 12, 24, 3, 4


def state(one: Received) -> DeformationState:
    """The state in a message.

    Raises:
        MalformedError: it cannot be read, or its covariance is not that of its theta.
    """
    message = decoded(DeformationState, one)
    size = len(message.theta)
    if message.covariance_valid:
        _check(one, len(message.covariance) == size * (size + 1) // 2, "covariance")
    return message


def compact(one: Received) -> CompactState:
    """Theta and status in a message.

    Raises:
        MalformedError: they cannot be read.
    """
    message = decoded(CompactState, one)
    _check(one, not len(message.theta_f32) % NUMBER, "theta_f32")
    _check(one, not len(message.offset_f32) % NUMBER, "offset_f32")
    return message


def mesh(one: Received) -> DeformedMesh:
    """The vertices in a message.

    Raises:
        MalformedError: they cannot be read, or their covariances are not those of the vertices.
    """
    message = decoded(DeformedMesh, one)
    count, rest = divmod(len(message.vertices_f32), VERTEX)
    _check(one, not rest, "vertices_f32")
    _check(one, len(message.covariance_f32) in (0, count * COVARIANCE), "covariance_f32")
    return message


def topology(one: Received) -> MeshTopology:
    """The topology in a message.

    Raises:
        MalformedError: it cannot be read, or its faces, colours or basis are not those of its vertices.
    """
    message = decoded(MeshTopology, one)
    count, rest = divmod(len(message.rest_vertices_f32), VERTEX)
    _check(one, not rest, "rest_vertices_f32")
    _check(one, not len(message.faces_u32) % FACE, "faces_u32")
    _check(one, (np.frombuffer(message.faces_u32, "<u4") < count).all(), "faces_u32")
    _check(one, len(message.colors_u8) in (0, count * COLOR), "colors_u8")
    basis, each = message.basis, count * message.basis.support
    tables = [len(table) // NUMBER for table in (basis.value_f32, basis.along_u_f32, basis.along_w_f32)]
    fits = (
        tables == [each] * 3 and len(basis.control_points_u16) == 2 * each and len(basis.offset_f32) == NUMBER * count
    )
    _check(one, not message.HasField("basis") or (each > 0 and fits), "basis")
    return message


def _check(one: Received, is_right: object, field: str) -> None:
    if not is_right:
        raise MalformedError(f"{one.key}: the size or content of {field} does not fit the rest of the message")
