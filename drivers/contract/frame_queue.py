"""Nonblocking bounded queue between the threads of an SDK and a driver's own."""

import threading
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class FrameQueue(Generic[Item]):
    """A queue of the newest items; when full, the oldest one is dropped.

    Args:
        depth: maximum number of items.
    """

    def __init__(self, depth: int = 4) -> None:
        self._items: deque[Item] = deque()
        self._depth = depth
        self._dropped = 0
        self._end = ""
        self._changed = threading.Condition()

    def put(self, item: Item) -> None:
        """Adds an item."""
        with self._changed:
            self._items.append(item)
            if len(self._items) > self._depth:
                self._items.popleft()
                self._dropped += 1
            self._changed.notify()

    def end(self, reason: str) -> None:
        """Marks the end: no items follow those in the queue."""
        with self._changed:
            self._end = reason

    def take(self, timeout_s: float) -> Item | None:
        """The oldest item, None after the timeout. Items may still follow the end mark."""
        with self._changed:
            self._changed.wait_for(lambda: self._items, timeout_s)
            return self._items.popleft() if self._items else None

    def ended(self) -> str:
        """Reason of the end once the queue is empty; "" before."""
        with self._changed:
            return "" if self._items else self._end

    def dropped(self) -> int:
        """Number of items dropped since the last call."""
        with self._changed:
            dropped, self._dropped = self._dropped, 0
            return dropped
