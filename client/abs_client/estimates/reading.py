"""The messages of an estimate, checked where they arrive: later, a broken array would end the reader's loop."""

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from abs_client.connection.received import Received, decoded
from abs_client.errors import MalformedError

#: Bytes of a vertex, a face, a vertex' covariance and its colour.
VERTEX, FACE, COVARIANCE, COLOR = 12, 12, 24, 3


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
        MalformedError: it cannot be read, or its faces or colours are not those of its vertices.
    """
    message = decoded(MeshTopology, one)
    count, rest = divmod(len(message.rest_vertices_f32), VERTEX)
    _check(one, not rest, "rest_vertices_f32")
    _check(one, not len(message.faces_u32) % FACE, "faces_u32")
    _check(one, (np.frombuffer(message.faces_u32, "<u4") < count).all(), "faces_u32")
    _check(one, len(message.colors_u8) in (0, count * COLOR), "colors_u8")
    return message


def _check(one: Received, is_right: object, field: str) -> None:
    if not is_right:
        raise MalformedError(f"{one.key}: the size or content of {field} does not fit the rest of the message")
