"""Validation of messages from other programs, by schema and range: defines, with `message_content`, valid messages.

A publisher can send any bytes. Messages that pass can be displayed, processed and recorded without another check.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from drivers.contract.text import MAX_LENGTH, is_printable
from drivers.encoding.message_content import CONTENT, MAX_POINTS, MessageError
from drivers.encoding.parsing import CodecError, parse_message

#: Largest message of any type [bytes]; of an image: 8192 × 8192 pixels of four bytes.
MAX_BYTES, MAX_IMAGE_BYTES = 1 << 24, 1 << 28
#: Longest text of a configuration [characters].
MAX_FILE_LENGTH = 1 << 20
#: Most entries of a map, and most texts or messages in a list.
MAX_ENTRIES = 2000
#: Largest image [pixels along a side].
MAX_SIDE_PX = 1 << 14
#: A larger gap in sequence numbers is no loss: the numbers are not those of one publisher.
MAX_GAP = 1_000_000

_TIME_NS = 1 << 62  # differences of two times fit into 64 bits

#: Ranges of integers, both ends allowed; all others have that of their type.
_RANGES: Mapping[str, tuple[int, int]] = {
    "google.protobuf.Timestamp.seconds": (0, (1 << 63) // 10**9 - 1),
    "google.protobuf.Timestamp.nanos": (0, 999_999_999),
    "absmsg.v1.Header.t_host_ns": (-_TIME_NS, _TIME_NS),
    "absmsg.v1.Header.seq": (0, 1 << 62),
    "absmsg.v1.FrameInfo.seq": (0, 1 << 62),
    "absmsg.v1.FrameInfo.t_sigma_ns": (0, _TIME_NS),
    "absmsg.v1.FrameInfo.t_arrival_ns": (-_TIME_NS, _TIME_NS),
    "absmsg.v1.Reinitialize.Pixel.column": (0, MAX_SIDE_PX - 1),
    "absmsg.v1.Reinitialize.Pixel.row": (0, MAX_SIDE_PX - 1),
    "absmsg.v1.DeformationState.Sensor.t_host_ns": (-_TIME_NS, _TIME_NS),
    "absmsg.v1.DeformationState.Sensor.seq": (0, 1 << 62),
    "absmsg.v1.SensorModel.width": (1, MAX_SIDE_PX),
    "absmsg.v1.SensorModel.height": (1, MAX_SIDE_PX),
    "foxglove.RawImage.width": (0, MAX_SIDE_PX),
    "foxglove.RawImage.height": (0, MAX_SIDE_PX),
}

#: Lists of which only the length is checked: points and colours that only viewers read.
_VIEWED = frozenset(f"foxglove.TriangleListPrimitive.{name}" for name in ("points", "colors"))

#: Numbers that are used without a look: neither NaN nor infinite. Of others, NaN and infinity mean unknown.
_FINITE = frozenset(
    {
        "absmsg.v1.DeformationState.theta",
        "absmsg.v1.DeformationState.solve_ms",
        "absmsg.v1.Health.GaugesEntry.value",
        "absmsg.v1.FrameInfo.scale",
        "absmsg.v1.FrameInfo.tick_hz",
        *(f"absmsg.v1.SensorModel.{name}" for name in ("fx", "fy", "cx", "cy", "lens", "T_rs")),
    }
)


_AnyMessage = TypeVar("_AnyMessage", bound=Message)


def parse_valid(schema: type[_AnyMessage], payload: bytes) -> _AnyMessage:
    """The message of a schema in serialized bytes, if it is a valid one.

    Raises:
        MessageError: too many or malformed bytes, or as `check`.
    """
    check_size(schema.DESCRIPTOR.full_name, payload)
    try:
        message = parse_message(schema, payload)
    except CodecError as error:
        raise MessageError("malformed", str(error)) from error
    check(message)
    return message


def check_size(message: str, payload: bytes) -> None:
    """Checks the size of a message of this full name.

    Raises:
        MessageError: it is too large.
    """
    largest = MAX_IMAGE_BYTES if message.endswith("Image") else MAX_BYTES
    if len(payload) > largest:
        raise MessageError("size", f"{message} of {len(payload)} bytes, {largest} are allowed")


def check(message: Message) -> None:
    """Checks texts, numbers and sizes of a parsed message.

    Raises:
        MessageError: one of them is not allowed; names it.
    """
    _check_fields(message)
    CONTENT.get(message.DESCRIPTOR.full_name, lambda _: None)(message)


def _check_fields(message: Message) -> None:
    for field, value in message.ListFields():
        name = field.full_name
        if field.message_type is not None and field.message_type.GetOptions().map_entry:
            _check_count(name, len(value))
            entry = field.message_type.fields_by_name
            _check_values(entry["key"], value)
            _check_values(entry["value"], value.values())
        elif name in _VIEWED:
            _check_count(name, len(value), MAX_POINTS)
        elif field.is_repeated:
            if field.cpp_type in (FieldDescriptor.CPPTYPE_MESSAGE, FieldDescriptor.CPPTYPE_STRING):
                _check_count(name, len(value))
            _check_values(field, value)
        else:
            _check_values(field, (value,))


def _check_values(field: FieldDescriptor, values: Iterable[Any]) -> None:
    """Checks all values of a field, of a list or of the keys or values of a map."""
    name, kind = field.full_name, field.cpp_type
    if kind == FieldDescriptor.CPPTYPE_MESSAGE:
        for value in values:
            _check_fields(value)
    elif kind == FieldDescriptor.CPPTYPE_STRING and field.type != FieldDescriptor.TYPE_BYTES:
        longest = MAX_FILE_LENGTH if name == "absmsg.v1.Config.toml" else MAX_LENGTH
        odd = next((value for value in values if not is_printable(value, longest)), None)
        if odd is not None:
            raise MessageError("text", f"{name} = {odd[:40]!r} is too long or cannot be printed")
    elif field.enum_type is not None:
        known = field.enum_type.values_by_number
        _require_all(name, values, known.__contains__, "range", f"must be one of {sorted(known)}")
    elif name in _FINITE:
        _require_all(name, values, math.isfinite, "number", "must be finite")
    elif name in _RANGES:
        low, high = _RANGES[name]
        _require_all(name, values, lambda value: low <= value <= high, "range", f"must be in {low} … {high}")


def _require_all(name: str, values: Iterable[Any], holds: Callable[[Any], bool], cause: str, rule: str) -> None:
    odd = next((value for value in values if not holds(value)), None)
    if odd is not None:
        raise MessageError(cause, f"{name} = {odd} {rule}")


def _check_count(name: str, number: int, maximum: int = MAX_ENTRIES) -> None:
    if number > maximum:
        raise MessageError("size", f"{name} has {number} entries, {maximum} are allowed")
