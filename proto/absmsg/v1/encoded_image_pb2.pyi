import datetime

from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class EncodedImage(_message.Message):
    __slots__ = ("timestamp", "frame_id", "width", "height", "encoding", "step", "codec", "predictor", "green_subtracted", "data")
    class Codec(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        CODEC_UNSPECIFIED: _ClassVar[EncodedImage.Codec]
        CODEC_RAW: _ClassVar[EncodedImage.Codec]
        CODEC_FILTERED_ZSTD: _ClassVar[EncodedImage.Codec]
    CODEC_UNSPECIFIED: EncodedImage.Codec
    CODEC_RAW: EncodedImage.Codec
    CODEC_FILTERED_ZSTD: EncodedImage.Codec
    class Predictor(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
        __slots__ = ()
        PREDICTOR_NONE: _ClassVar[EncodedImage.Predictor]
        PREDICTOR_LEFT: _ClassVar[EncodedImage.Predictor]
        PREDICTOR_ABOVE: _ClassVar[EncodedImage.Predictor]
        PREDICTOR_GRADIENT: _ClassVar[EncodedImage.Predictor]
    PREDICTOR_NONE: EncodedImage.Predictor
    PREDICTOR_LEFT: EncodedImage.Predictor
    PREDICTOR_ABOVE: EncodedImage.Predictor
    PREDICTOR_GRADIENT: EncodedImage.Predictor
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    STEP_FIELD_NUMBER: _ClassVar[int]
    CODEC_FIELD_NUMBER: _ClassVar[int]
    PREDICTOR_FIELD_NUMBER: _ClassVar[int]
    GREEN_SUBTRACTED_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    width: int
    height: int
    encoding: str
    step: int
    codec: EncodedImage.Codec
    predictor: EncodedImage.Predictor
    green_subtracted: bool
    data: bytes
    def __init__(self, timestamp: _Optional[_Union[datetime.datetime, _timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., width: _Optional[int] = ..., height: _Optional[int] = ..., encoding: _Optional[str] = ..., step: _Optional[int] = ..., codec: _Optional[_Union[EncodedImage.Codec, str]] = ..., predictor: _Optional[_Union[EncodedImage.Predictor, str]] = ..., green_subtracted: _Optional[bool] = ..., data: _Optional[bytes] = ...) -> None: ...
