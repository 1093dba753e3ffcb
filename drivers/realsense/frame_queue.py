"""What lies between librealsense's threads and ours: they put, and wait for nobody; we take."""

import threading
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class FrameQueue(Generic[Item]):
    """The newest few items; the oldest one is dropped rather than let anybody wait.

    Args:
        depth: how many.
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
        """Says that nothing will come after what is in it."""
        with self._changed:
            self._end = reason

    def take(self, timeout_s: float) -> Item | None:
        """The oldest item, None if none comes for so long. What was said to be the end may have overtaken the last."""
        with self._changed:
            self._changed.wait_for(lambda: self._items, timeout_s)
            return self._items.popleft() if self._items else None

    def ended(self) -> str:
        """Why nothing will come any more; "" while something may."""
        with self._changed:
            return "" if self._items else self._end

    def dropped(self) -> int:
        """How many items were dropped since this was asked last."""
        with self._changed:
            dropped, self._dropped = self._dropped, 0
            return dropped
