from absmsg.v1 import common_pb2 as _common_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class FrameInfo(_message.Message):
    __slots__ = ("header", "sensor", "stream", "kind", "seq", "epoch", "scale", "geometry", "invalid", "t_device_ticks", "tick_hz", "clock_domain", "t_sigma_ns", "t_reference", "t_arrival_ns", "exposure_s", "gain", "temperature_c", "modulation", "calib_id", "undistorted", "filters", "incomplete", "saturated", "unit", "aligned_to")
    class Geometry(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        GEOMETRY_NONE: _ClassVar[FrameInfo.Geometry]
        GEOMETRY_Z: _ClassVar[FrameInfo.Geometry]
        GEOMETRY_RADIAL: _ClassVar[FrameInfo.Geometry]
    GEOMETRY_NONE: FrameInfo.Geometry
    GEOMETRY_Z: FrameInfo.Geometry
    GEOMETRY_RADIAL: FrameInfo.Geometry
    class Reference(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        REFERENCE_MIDDLE: _ClassVar[FrameInfo.Reference]
        REFERENCE_START: _ClassVar[FrameInfo.Reference]
        REFERENCE_END: _ClassVar[FrameInfo.Reference]
    REFERENCE_MIDDLE: FrameInfo.Reference
    REFERENCE_START: FrameInfo.Reference
    REFERENCE_END: FrameInfo.Reference
    HEADER_FIELD_NUMBER: _ClassVar[int]
    SENSOR_FIELD_NUMBER: _ClassVar[int]
    STREAM_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    EPOCH_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    GEOMETRY_FIELD_NUMBER: _ClassVar[int]
    INVALID_FIELD_NUMBER: _ClassVar[int]
    T_DEVICE_TICKS_FIELD_NUMBER: _ClassVar[int]
    TICK_HZ_FIELD_NUMBER: _ClassVar[int]
    CLOCK_DOMAIN_FIELD_NUMBER: _ClassVar[int]
    T_SIGMA_NS_FIELD_NUMBER: _ClassVar[int]
    T_REFERENCE_FIELD_NUMBER: _ClassVar[int]
    T_ARRIVAL_NS_FIELD_NUMBER: _ClassVar[int]
    EXPOSURE_S_FIELD_NUMBER: _ClassVar[int]
    GAIN_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_C_FIELD_NUMBER: _ClassVar[int]
    MODULATION_FIELD_NUMBER: _ClassVar[int]
    CALIB_ID_FIELD_NUMBER: _ClassVar[int]
    UNDISTORTED_FIELD_NUMBER: _ClassVar[int]
    FILTERS_FIELD_NUMBER: _ClassVar[int]
    INCOMPLETE_FIELD_NUMBER: _ClassVar[int]
    SATURATED_FIELD_NUMBER: _ClassVar[int]
    UNIT_FIELD_NUMBER: _ClassVar[int]
    ALIGNED_TO_FIELD_NUMBER: _ClassVar[int]
    header: _common_pb2.Header
    sensor: str
    stream: str
    kind: str
    seq: int
    epoch: int
    scale: float
    geometry: FrameInfo.Geometry
    invalid: float
    t_device_ticks: int
    tick_hz: float
    clock_domain: str
    t_sigma_ns: int
    t_reference: FrameInfo.Reference
    t_arrival_ns: int
    exposure_s: float
    gain: float
    temperature_c: float
    modulation: str
    calib_id: str
    undistorted: bool
    filters: _containers.RepeatedScalarFieldContainer[str]
    incomplete: bool
    saturated: bool
    unit: str
    aligned_to: str
    def __init__(self, header: _Optional[_Union[_common_pb2.Header, _Mapping]] = ..., sensor: _Optional[str] = ..., stream: _Optional[str] = ..., kind: _Optional[str] = ..., seq: _Optional[int] = ..., epoch: _Optional[int] = ..., scale: _Optional[float] = ..., geometry: _Optional[_Union[FrameInfo.Geometry, str]] = ..., invalid: _Optional[float] = ..., t_device_ticks: _Optional[int] = ..., tick_hz: _Optional[float] = ..., clock_domain: _Optional[str] = ..., t_sigma_ns: _Optional[int] = ..., t_reference: _Optional[_Union[FrameInfo.Reference, str]] = ..., t_arrival_ns: _Optional[int] = ..., exposure_s: _Optional[float] = ..., gain: _Optional[float] = ..., temperature_c: _Optional[float] = ..., modulation: _Optional[str] = ..., calib_id: _Optional[str] = ..., undistorted: _Optional[bool] = ..., filters: _Optional[_Iterable[str]] = ..., incomplete: _Optional[bool] = ..., saturated: _Optional[bool] = ..., unit: _Optional[str] = ..., aligned_to: _Optional[str] = ...) -> None: ...
