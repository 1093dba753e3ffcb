import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Header(_message.Message):
    __slots__ = ("stamp", "t_host_ns", "seq", "rig", "frame_id", "boot_id", "host_clock")
    STAMP_FIELD_NUMBER: _ClassVar[int]
    T_HOST_NS_FIELD_NUMBER: _ClassVar[int]
    SEQ_FIELD_NUMBER: _ClassVar[int]
    RIG_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    HOST_CLOCK_FIELD_NUMBER: _ClassVar[int]
    stamp: _timestamp_pb2.Timestamp
    t_host_ns: int
    seq: int
    rig: str
    frame_id: str
    boot_id: str
    host_clock: str
    def __init__(self, stamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., t_host_ns: _Optional[int] = ..., seq: _Optional[int] = ..., rig: _Optional[str] = ..., frame_id: _Optional[str] = ..., boot_id: _Optional[str] = ..., host_clock: _Optional[str] = ...) -> None: ...
