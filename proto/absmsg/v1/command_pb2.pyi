from absmsg.v1 import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Reinitialize(_message.Message):
    __slots__ = ("header", "tracker", "seed", "polygon")
    class Pixel(_message.Message):
        __slots__ = ("column", "row")
        COLUMN_FIELD_NUMBER: _ClassVar[int]
        ROW_FIELD_NUMBER: _ClassVar[int]
        column: int
        row: int
        def __init__(self, column: _Optional[int] = ..., row: _Optional[int] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRACKER_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    POLYGON_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    tracker: str
    seed: Reinitialize.Pixel
    polygon: _containers.RepeatedCompositeFieldContainer[Reinitialize.Pixel]
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., tracker: _Optional[str] = ..., seed: _Optional[_Union[Reinitialize.Pixel, _Mapping]] = ..., polygon: _Optional[_Iterable[_Union[Reinitialize.Pixel, _Mapping]]] = ...) -> None: ...

class Record(_message.Message):
    __slots__ = ("header", "recording")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    recording: bool
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., recording: _Optional[bool] = ...) -> None: ...

class Reload(_message.Message):
    __slots__ = ("header",)
    HEADER_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ...) -> None: ...

class Control(_message.Message):
    __slots__ = ("name", "on", "whole", "number", "choice", "unit", "minimum", "maximum", "choices")
    NAME_FIELD_NUMBER: _ClassVar[int]
    ON_FIELD_NUMBER: _ClassVar[int]
    WHOLE_FIELD_NUMBER: _ClassVar[int]
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    CHOICE_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    MINIMUM_FIELD_NUMBER: _ClassVar[int]
    MAXIMUM_FIELD_NUMBER: _ClassVar[int]
    CHOICES_FIELD_NUMBER: _ClassVar[int]
    name: str
    on: bool
    whole: int
    number: float
    choice: str
    unit: str
    minimum: float
    maximum: float
    choices: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, name: _Optional[str] = ..., on: _Optional[bool] = ..., whole: _Optional[int] = ..., number: _Optional[float] = ..., choice: _Optional[str] = ..., unit: _Optional[str] = ..., minimum: _Optional[float] = ..., maximum: _Optional[float] = ..., choices: _Optional[_Iterable[str]] = ...) -> None: ...

class SetControls(_message.Message):
    __slots__ = ("header", "device", "controls")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    CONTROLS_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    device: str
    controls: _containers.RepeatedCompositeFieldContainer[Control]
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., device: _Optional[str] = ..., controls: _Optional[_Iterable[_Union[Control, _Mapping]]] = ...) -> None: ...

class CommandAnswer(_message.Message):
    __slots__ = ("header", "accepted", "reason", "region", "restarts", "controls", "ends")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    REGION_FIELD_NUMBER: _ClassVar[int]
    RESTARTS_FIELD_NUMBER: _ClassVar[int]
    CONTROLS_FIELD_NUMBER: _ClassVar[int]
    ENDS_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    accepted: bool
    reason: str
    region: str
    restarts: _containers.RepeatedScalarFieldContainer[str]
    controls: _containers.RepeatedCompositeFieldContainer[Control]
    ends: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., accepted: _Optional[bool] = ..., reason: _Optional[str] = ..., region: _Optional[str] = ..., restarts: _Optional[_Iterable[str]] = ..., controls: _Optional[_Iterable[_Union[Control, _Mapping]]] = ..., ends: _Optional[_Iterable[str]] = ...) -> None: ...
