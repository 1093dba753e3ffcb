"""The bytes of a file whose disk may have bad blocks, or that is truncated while it is read.

A file that is mapped into memory would end the process then (SIGBUS), at every start.
"""

import os

#: Bytes that are read at once, and those of a block that a disk gives or does not.
WINDOW, BLOCK = 1 << 20, 4096


class FileBytes:
    """Bytes of an open file, as `bytes` has them: `len`, slices, `find`. What the disk does not give are zeros.

    Args:
        descriptor: of the file, which stays open.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._size = os.fstat(descriptor).st_size
        self._begin, self._window = 0, b""

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, part: slice) -> bytes:
        begin, end, _ = part.indices(self._size)
        if end - begin > WINDOW:
            return self._read(begin, end)
        if not self._begin <= begin <= end <= self._begin + len(self._window):
            self._move(begin)
        return self._window[begin - self._begin : max(end, begin) - self._begin]

    def find(self, byte: bytes, start: int) -> int:
        """Position of the first such byte at or after `start`; -1 if there is none."""
        while start < self._size:
            if not self._begin <= start < self._begin + len(self._window):
                self._move(start)
            found = self._window.find(byte, start - self._begin)  # not in a copy: random bytes have 4096 in each
            if found >= 0:
                return self._begin + found
            start = self._begin + len(self._window)
        return -1

    def _move(self, begin: int) -> None:
        self._begin, self._window = begin, self._read(begin, min(begin + WINDOW, self._size))

    def _read(self, begin: int, end: int) -> bytes:
        try:
            data = os.pread(self._descriptor, end - begin, begin)
        except OSError:
            if end - begin <= BLOCK:
                return bytes(end - begin)
            middle = begin + max((end - begin) // 2 // BLOCK, 1) * BLOCK
            return self._read(begin, middle) + self._read(middle, end)
        if data and len(data) < end - begin:
            return data + self._read(begin + len(data), end)
        return data or bytes(end - begin)
