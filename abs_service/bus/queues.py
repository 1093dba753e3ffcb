"""Bounded queues between threads. None ever blocks the side that puts; each counts what it drops, by key.

zenoh has channels of its own, but they do not say what they dropped, and one cannot wait on them for a limited time.
"""

import threading
from collections import Counter, deque
from collections.abc import Mapping
from typing import Generic, TypeVar

T = TypeVar("T")


class LatestQueue(Generic[T]):
    """Keeps the newest `depth` items of every key: for readers that want the present, not the past.

    Args:
        depth: items kept per key, at least one; one more pushes out the oldest of that key.
    """

    def __init__(self, depth: int) -> None:
        self._depth = depth
        self._items: deque[tuple[str, T]] = deque()
        self._waiting: Counter[str] = Counter()
        self._dropped: Counter[str] = Counter()
        self._changed = threading.Condition()
        self._closed = False

    @property
    def dropped(self) -> Mapping[str, int]:
        """Items that were pushed out before anyone took them, by key."""
        with self._changed:
            return dict(self._dropped)

    def put(self, key: str, item: T) -> None:
        """Adds an item; drops the key's oldest if there are `depth` already. Items put after `close` are ignored."""
        with self._changed:
            if self._closed:
                return
            if self._waiting[key] == self._depth:
                oldest = next(i for i, (other, _) in enumerate(self._items) if other == key)
                del self._items[oldest]
                self._dropped[key] += 1
            else:
                self._waiting[key] += 1
            self._items.append((key, item))
            self._changed.notify()

    def take(self, timeout_s: float | None = None) -> tuple[str, T] | None:
        """The item that waits longest, with its key; None once `timeout_s` is over or the queue is closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            key, item = self._items.popleft()
            self._waiting[key] -= 1
            return key, item

    def close(self) -> None:
        """Refuses further items and wakes whoever waits; what is queued can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class BoundedQueue(Generic[T]):
    """Keeps everything in order up to a size: for the recorder, which wants all of it.

    A full queue refuses the newcomer, so that what is kept has no holes but at the end.

    Args:
        capacity: largest sum of the items' sizes that may wait [bytes].
    """

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._items: deque[tuple[str, T, int]] = deque()
        self._size = 0
        self._dropped: Counter[str] = Counter()
        self._changed = threading.Condition()
        self._closed = False

    @property
    def dropped(self) -> Mapping[str, int]:
        """Items that were refused because the queue was full, by key."""
        with self._changed:
            return dict(self._dropped)

    @property
    def is_drained(self) -> bool:
        """Whether nothing waits and nothing will come any more."""
        with self._changed:
            return self._closed and not self._items

    @property
    def size(self) -> int:
        """Sum of the sizes of the items that wait [bytes]."""
        with self._changed:
            return self._size

    def put(self, key: str, item: T, size: int) -> None:
        """Adds an item of `size` bytes, or counts it as dropped. Items put after `close` are ignored."""
        with self._changed:
            if self._closed:
                return
            if self._size + size > self._capacity:
                self._dropped[key] += 1
                return
            self._items.append((key, item, size))
            self._size += size
            self._changed.notify()

    def take(self, timeout_s: float | None = None) -> T | None:
        """The item that waits longest; None once `timeout_s` is over or the queue is closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            _, item, size = self._items.popleft()
            self._size -= size
            return item

    def close(self) -> None:
        """Refuses further items and wakes whoever waits; what is queued can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
