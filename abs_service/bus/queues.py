"""Bounded queues between threads. The producer never blocks; dropped items are counted by key.

zenoh's own channels neither count what they drop nor allow a wait with a timeout.
"""

import threading
from collections import Counter, deque
from collections.abc import Mapping
from typing import Generic, TypeVar

T = TypeVar("T")


class LatestQueue(Generic[T]):
    """Keeps the newest `depth` items of every key: for consumers that need current data.

    Args:
        depth: items kept per key, at least one; a further one replaces the oldest of that key.
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
        """Items dropped for newer ones, by key."""
        with self._changed:
            return dict(self._dropped)

    def __len__(self) -> int:
        """Number of items that wait."""
        return len(self._items)

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
        """The oldest item, with its key; None once `timeout_s` is over or the queue is closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            key, item = self._items.popleft()
            self._waiting[key] -= 1
            return key, item

    def close(self) -> None:
        """Ignores further items and wakes waiting threads; queued items can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class BoundedQueue(Generic[T]):
    """A FIFO queue bounded by size: for the recorder, which needs every item.

    A full queue drops the new item, so that the queued ones have no gaps.

    Args:
        capacity: largest sum of the sizes of the queued items [bytes].
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
        """True if the queue is closed and empty."""
        with self._changed:
            return self._closed and not self._items

    @property
    def size(self) -> int:
        """Sum of the sizes of the queued items [bytes]."""
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
        """The oldest item; None once `timeout_s` is over or the queue is closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            _, item, size = self._items.popleft()
            self._size -= size
            return item

    def drop_all(self) -> None:
        """Drops and counts all items."""
        with self._changed:
            self._dropped.update(key for key, _, _ in self._items)
            self._items.clear()
            self._size = 0

    def close(self) -> None:
        """Ignores further items and wakes waiting threads; queued items can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
