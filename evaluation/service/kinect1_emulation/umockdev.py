"""A program whose ioctls umockdev's preloaded library sends to a socket.

The protocol is umockdev's own and internal: 24 bytes in (command, request, argument), and out as many of "read so many
bytes at an address of yours" and "write these" as are needed before "done, with this result".
"""

import socket
import struct
from collections.abc import Iterator
from typing import Any

# umockdev's commands.
_DONE, _RUN, _READ_MEMORY, _WRITE_MEMORY, _READ, _WRITE = 3, 4, 5, 6, 7, 8
_MESSAGE = struct.Struct("<QQQ")
_RESULT = struct.Struct("<qqq")


class Program:
    """The program that has one file open: its ioctls, and its memory."""

    def __init__(self, stream: socket.socket) -> None:
        self._stream = stream

    def ioctls(self) -> Iterator[tuple[int, int]]:
        """Request and argument of each ioctl until the program closes the file; `done` has to follow."""
        with self._stream:
            while message := self._receive(_MESSAGE.size):
                command, request, argument = _MESSAGE.unpack(message)
                if command in {_READ, _WRITE}:  # of the file itself, which holds the descriptors: may be done there
                    self._stream.sendall(_MESSAGE.pack(_RUN, 0, 0))
                    self._receive(_MESSAGE.size)
                    self._stream.sendall(_RESULT.pack(_DONE, 0, 0))
                    continue
                yield request, argument

    def done(self, result: int) -> None:
        """Ends an ioctl with its result, negative errno if it fails."""
        self._stream.sendall(_RESULT.pack(_DONE, -1 if result < 0 else result, -min(result, 0)))

    def read(self, address: int, size: int) -> bytes:
        """Bytes in the program's memory."""
        self._stream.sendall(_MESSAGE.pack(_READ_MEMORY, address, size))
        return self._receive(size)

    def write(self, address: int, data: Any) -> None:
        """Bytes into the program's memory."""
        if data:
            self._stream.sendall(_MESSAGE.pack(_WRITE_MEMORY, address, len(data)) + data)

    def _receive(self, size: int) -> bytes:
        parts = bytearray()
        while len(parts) < size:
            part = self._stream.recv(size - len(parts))
            if not part:
                return b""
            parts += part
        return bytes(parts)
