from absmsg.v1 import common_pb2 as _common_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DeformedMesh(_message.Message):
    __slots__ = ("header", "tracker", "mesh_version", "vertices_f32", "covariance_f32", "rim_classes_u8")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    MESH_VERSION_FIELD_NUMBER: _ClassVar[int]
    VERTICES_F32_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_F32_FIELD_NUMBER: _ClassVar[int]
    RIM_CLASSES_U8_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    mesh_version: int
    vertices_f32: bytes
    covariance_f32: bytes
    rim_classes_u8: bytes
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., mesh_version: _Optional[int] = ..., vertices_f32: _Optional[bytes] = ..., covariance_f32: _Optional[bytes] = ..., rim_classes_u8: _Optional[bytes] = ...) -> None: ...

class MeshTopology(_message.Message):
    __slots__ = ("header", "tracker", "mesh_version", "rest_vertices_f32", "faces_u32", "colors_u8", "basis")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    MESH_VERSION_FIELD_NUMBER: _ClassVar[int]
    REST_VERTICES_F32_FIELD_NUMBER: _ClassVar[int]
    FACES_U32_FIELD_NUMBER: _ClassVar[int]
    COLORS_U8_FIELD_NUMBER: _ClassVar[int]
    BASIS_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    mesh_version: int
    rest_vertices_f32: bytes
    faces_u32: bytes
    colors_u8: bytes
    basis: VertexBasis
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., mesh_version: _Optional[int] = ..., rest_vertices_f32: _Optional[bytes] = ..., faces_u32: _Optional[bytes] = ..., colors_u8: _Optional[bytes] = ..., basis: _Optional[_Union[VertexBasis, _Mapping]] = ...) -> None: ...

class VertexBasis(_message.Message):
    __slots__ = ("support", "control_points_u16", "value_f32", "along_u_f32", "along_w_f32", "offset_f32")
    SUPPORT_FIELD_NUMBER: _ClassVar[int]
    CONTROL_POINTS_U16_FIELD_NUMBER: _ClassVar[int]
    VALUE_F32_FIELD_NUMBER: _ClassVar[int]
    ALONG_U_F32_FIELD_NUMBER: _ClassVar[int]
    ALONG_W_F32_FIELD_NUMBER: _ClassVar[int]
    OFFSET_F32_FIELD_NUMBER: _ClassVar[int]
    support: int
    control_points_u16: bytes
    value_f32: bytes
    along_u_f32: bytes
    along_w_f32: bytes
    offset_f32: bytes
    def __init__(self, support: _Optional[int] = ..., control_points_u16: _Optional[bytes] = ..., value_f32: _Optional[bytes] = ..., along_u_f32: _Optional[bytes] = ..., along_w_f32: _Optional[bytes] = ..., offset_f32: _Optional[bytes] = ...) -> None: ...
