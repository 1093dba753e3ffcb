from absmsg.v1 import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SensorModel(_message.Message):
    __slots__ = ("header", "sensor", "width", "height", "fx", "fy", "cx", "cy", "lens", "T_rs", "calib_id", "noise", "noise_parameters", "lens_model")
    class NoiseParametersEntry(_message.Message):
        __slots__ = ("key", "value")
        KEY_FIELD_NUMBER: _ClassVar[int]
        VALUE_FIELD_NUMBER: _ClassVar[int]
        key: str
        value: NumberList
        def __init__(self, key: _Optional[str] = ..., value: _Optional[_Union[NumberList, _Mapping]] = ...) -> None: ...
    HEADER_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    FX_FIELD_NUMBER: _ClassVar[int]
    FY_FIELD_NUMBER: _ClassVar[int]
    CX_FIELD_NUMBER: _ClassVar[int]
    CY_FIELD_NUMBER: _ClassVar[int]
    LENS_FIELD_NUMBER: _ClassVar[int]
    T_RS_FIELD_NUMBER: _ClassVar[int]
    CALIB_ID_FIELD_NUMBER: _ClassVar[int]
    NOISE_FIELD_NUMBER: _ClassVar[int]
    NOISE_PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    LENS_MODEL_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    sensor: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    lens: _containers.RepeatedScalarFieldContainer[float]
    T_rs: _containers.RepeatedScalarFieldContainer[float]
    calib_id: str
    noise: str
    noise_parameters: _containers.MessageMap[str, NumberList]
    lens_model: str
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., sensor: _Optional[str] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., fx: _Optional[float] = ..., fy: _Optional[float] = ..., cx: _Optional[float] = ..., cy: _Optional[float] = ..., lens: _Optional[_Iterable[float]] = ..., T_rs: _Optional[_Iterable[float]] = ..., calib_id: _Optional[str] = ..., noise: _Optional[str] = ..., noise_parameters: _Optional[_Mapping[str, NumberList]] = ..., lens_model: _Optional[str] = ...) -> None: ...

class NumberList(_message.Message):
    __slots__ = ("values",)
    VALUES_FIELD_NUMBER: _ClassVar[int]
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, values: _Optional[_Iterable[float]] = ...) -> None: ...

class Config(_message.Message):
    __slots__ = ("header", "toml", "sha256", "version")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TOML_FIELD_NUMBER: _ClassVar[int]
    SHA256_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    toml: str
    sha256: str
    version: str
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., toml: _Optional[str] = ..., sha256: _Optional[str] = ..., version: _Optional[str] = ...) -> None: ...
