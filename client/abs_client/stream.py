"""Iterators over what is newest: with `for`, with `async for`, or one at a time."""

import asyncio
import threading
import weakref
from collections.abc import AsyncIterator, Callable, Iterator
from time import monotonic
from typing import Generic, Protocol, Self, TypeVar

from abs_client.connection.link import Link
from abs_client.connection.wake import Wake
from abs_client.errors import ClientError

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class NothingReceivedError(ClientError, TimeoutError):
    """Timeout: no message came in time."""


class Source(Protocol[T_co]):
    """Origin of the items of a stream."""

    @property
    def skipped(self) -> int:
        """Items that newer ones have replaced before they were taken, or that were too old."""
        ...

    def take(self) -> T_co | None:
        """The newest item that was not taken yet."""
        ...

    def due_s(self) -> float:
        """Time until `take` may have an item without a signal [s]."""
        ...


class Stream(Generic[T]):
    """Gives the newest item to a reader of any speed; what it is too slow for is left out and counted.

    Use it with `for` or with `async for`, in one place. It ends with `close` or a `with` block, at the latest with the
    program, and, if it made its connection itself, together with that.

    Args:
        source: the items.
        wake: signalled when there is one.
        link: keeps the connection as long as this stream.
        close: ends what this stream alone uses; must not hold the stream.
    """

    def __init__(self, source: Source[T], wake: Wake, link: Link, close: Callable[[], None]) -> None:
        self._source = source
        self._wake = wake
        self._link = link
        self._close = weakref.finalize(self, close)
        self._closed = threading.Event()
        link.wake_at_end(wake)

    @property
    def skipped(self) -> int:
        """Items so far that this reader did not get: it was too slow for them, or they came too old."""
        return self._source.skipped

    def next(self, timeout_s: float) -> T:
        """The next item; with 0, the one that is there.

        Raises:
            NothingReceivedError: there was none within `timeout_s`, or the stream was closed.
        """
        end_s = monotonic() + timeout_s
        while not self._ended:
            if (item := self._source.take()) is not None:
                return item
            if (left_s := end_s - monotonic()) <= 0:
                raise NothingReceivedError(f"nothing came within {timeout_s:g} s")
            self._wake.wait(min(left_s, self._source.due_s()))
        raise NothingReceivedError("the stream, or its connection, was closed")

    @property
    def _ended(self) -> bool:
        return self._closed.is_set() or self._link.closed

    def close(self) -> None:
        """Ends the iteration; from any thread, again if you like."""
        self._closed.set()
        self._wake.signal()
        self._close()

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
        while not self._ended:
            if (item := self._source.take()) is not None:
                return item
            self._wake.wait(self._source.due_s())
        raise StopIteration

    def __aiter__(self) -> AsyncIterator[T]:
        return self

    async def __anext__(self) -> T:
        # Other tasks, and a cancellation of this one, have their turn even if there always is an item.
        await asyncio.sleep(0)
        while not self._ended:
            if (item := self._source.take()) is not None:
                return item
            await self._wake.wait_async(self._source.due_s())
        raise StopAsyncIteration

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
