"""Results that several callers of one frame ask for."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Memo(Generic[Key, Value]):
    """Results of a pure function within one frame, each computed once; the order of the calls changes none.

    An object of a frame owns it, so it is gone with the frame.

    Args:
        known: results that are there already.
    """

    def __init__(self, known: dict[Key, Value] | None = None):
        self._known = {} if known is None else known

    def get(self, key: Key, compute: Callable[[Key], Value]) -> Value:
        """The result for a key; `compute` makes one that is not known."""
        if key not in self._known:
            self._known[key] = compute(key)
        return self._known[key]
