"""Cameras that delivered no image when the mesh was built: once they do, mesh and appearance are built again."""

from collections.abc import Collection


class AppearanceMonitor:
    """Decides when to build the appearance in further cameras; one for each mesh.

    Args:
        unknown: names of the sensors in which the appearance of the mesh is unknown.
        every_s: least time between two attempts [s].
    """

    def __init__(self, unknown: Collection[str], every_s: float):
        self._unknown = frozenset(unknown)
        self._every_s = every_s
        self._tried_ns: int | None = None
        self._reasons: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Cameras that deliver images which do not count yet, each with the reason; empty if there are none."""
        return self._reasons

    def take_attempt(self, missing: Collection[str], t_ns: int) -> bool:
        """True if an attempt is due at `t_ns` [ns], which then counts as made.

        Args:
            missing: sensors without an image at that time.
            t_ns: CLOCK_MONOTONIC [ns].
        """
        if self._unknown <= set(missing):
            return False
        if self._tried_ns is not None and t_ns - self._tried_ns < self._every_s * 1e9:
            return False
        self._tried_ns = t_ns
        return True

    def failed(self, reason: str) -> None:
        """Keeps the reason for which the last attempt failed."""
        self._reasons = (f"not used yet: {', '.join(sorted(self._unknown))} ({reason})",)
