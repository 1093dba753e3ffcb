"""Output that never blocks: not by a halted terminal (Ctrl-S), a pipe without a reader, or a full disk."""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import IO, Generic, Self, TextIO, TypeVar, cast

from abs_service.bus.queues import LatestQueue

T = TypeVar("T")

#: Texts or entries that wait for a reader that stands still; further ones replace the oldest.
DEPTH = 1000
#: Time that a reader has at the end for what is left [s].
END_S = 1.0


class Background(Generic[T]):
    """Passes items to a function that may block, in a thread of its own. Used in a `with` statement.

    Args:
        act: the function; OSErrors of it are counted, BrokenPipeError ends the work.
    """

    def __init__(self, act: Callable[[T], object]) -> None:
        self._act = act
        self._queue: LatestQueue[T] = LatestQueue(DEPTH)
        self._failed, self._error = 0, "its reader stands still"
        self._busy = self._gone = False
        # A daemon: nobody can end a write that blocks.
        self._thread = threading.Thread(target=self._run, name="output", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        with suppress(BrokenPipeError):
            self.finish()

    @property
    def idle(self) -> bool:
        """True if everything was taken."""
        return not self._busy and not len(self._queue)

    @property
    def lost(self) -> int:
        """Items that were dropped, could not be written, or wait still."""
        return self._failed + sum(self._queue.dropped.values()) + len(self._queue) + self._busy

    def put(self, item: T) -> None:
        """Hands an item over; raises BrokenPipeError if the reader is gone."""
        if self._gone:
            raise BrokenPipeError
        self._queue.put("", item)

    def finish(self) -> str:
        """Waits until all is written, `END_S` at most; takes nothing more. Returns what is missing, "" if nothing is.

        Raises:
            BrokenPipeError: the reader is gone.
        """
        self._queue.close()
        self._thread.join(END_S)
        if self._gone:
            raise BrokenPipeError
        return f"up to {self.lost} lines of output are missing: {self._error}" if self.lost else ""

    def _run(self) -> None:
        while (taken := self._queue.take()) is not None:
            self._busy = True
            try:
                self._act(taken[1])
            except BrokenPipeError:
                self._gone = True
                return
            except OSError as error:
                self._failed, self._error = self._failed + 1, error.strerror
            finally:
                self._busy = False


class Output(Background[str]):
    """Text for a file, as `print` and rich write it."""

    @property
    def file(self) -> IO[str]:
        """The same as a file object for rich, which only writes and flushes."""
        return cast(IO[str], self)

    def write(self, text: str) -> int:
        """Hands a text over, as one item; returns its length. Raises BrokenPipeError if the reader is gone."""
        self.put(text)
        return len(text)

    def flush(self) -> None:
        """No operation: the thread writes at once."""


def of(file: TextIO) -> Output:
    """Output to a file by its descriptor: a lock of the file, held for ever, would not let the interpreter end."""
    return Output(partial(_write_all, file.fileno(), file.encoding))


def _write_all(descriptor: int, encoding: str, text: str) -> None:
    left = memoryview(text.encode(encoding, "replace"))
    while left:
        left = left[os.write(descriptor, left) :]
