from absmsg.v1 import common_pb2 as _common_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SurfaceTruth(_message.Message):
    __slots__ = ("header", "seq", "rows", "columns", "points_f32", "surface")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    POINTS_F32_FIELD_NUMBER: _ClassVar[int]
    SURFACE_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    seq: int
    rows: int
    columns: int
    points_f32: bytes
    surface: int
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., seq: _Optional[int] = ..., rows: _Optional[int] = ..., columns: _Optional[int] = ..., points_f32: _Optional[bytes] = ..., surface: _Optional[int] = ...) -> None: ...
