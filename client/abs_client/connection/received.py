"""Messages as they arrive, and what is in them."""

from dataclasses import dataclass
from typing import TypeVar

from google.protobuf.message import DecodeError, Message

from abs_client.errors import MalformedError

M = TypeVar("M", bound=Message)


@dataclass(frozen=True)
class Received:
    """A message as it arrived.

    Attributes:
        key: zenoh's key, `abs/<rig>/<topic>`.
        payload, attachment: the bytes; b"" if there is no attachment.
    """

    key: str
    payload: bytes
    attachment: bytes = b""


def decoded(kind: type[M], one: Received) -> M:
    """The message in the payload.

    Raises:
        MalformedError: there is none.
    """
    return decoded_bytes(kind, one.payload, one.key)


def decoded_bytes(kind: type[M], data: bytes, key: str) -> M:
    """The message in bytes that arrived with a key; raises as `decoded`."""
    try:
        return kind.FromString(data)
    except DecodeError as error:
        raise MalformedError(f"{key}: {len(data)} bytes that are no {kind.DESCRIPTOR.full_name}") from error
