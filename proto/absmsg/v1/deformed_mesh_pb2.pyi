from absmsg.v1 import common_pb2 as _common_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DeformedMesh(_message.Message):
    __slots__ = ("header", "tracker", "mesh_version", "vertices_f32", "covariance_f32")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    MESH_VERSION_FIELD_NUMBER: _ClassVar[int]
    VERTICES_F32_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_F32_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    mesh_version: int
    vertices_f32: bytes
    covariance_f32: bytes
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., mesh_version: _Optional[int] = ..., vertices_f32: _Optional[bytes] = ..., covariance_f32: _Optional[bytes] = ...) -> None: ...

class MeshTopology(_message.Message):
    __slots__ = ("header", "tracker", "mesh_version", "rest_vertices_f32", "faces_u32", "colors_u8")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    MESH_VERSION_FIELD_NUMBER: _ClassVar[int]
    REST_VERTICES_F32_FIELD_NUMBER: _ClassVar[int]
    FACES_U32_FIELD_NUMBER: _ClassVar[int]
    COLORS_U8_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    mesh_version: int
    rest_vertices_f32: bytes
    faces_u32: bytes
    colors_u8: bytes
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., mesh_version: _Optional[int] = ..., rest_vertices_f32: _Optional[bytes] = ..., faces_u32: _Optional[bytes] = ..., colors_u8: _Optional[bytes] = ...) -> None: ...
