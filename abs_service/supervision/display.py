"""Interface of a display of a running rig."""

from typing import Protocol, Self

from abs_service.supervision.health.rig_view import RigView
from abs_service.tracking.log.tracker_log import EstimateReport


class Display(Protocol):
    """Shows a running rig. Used in a `with` statement; after it, the terminal is restored.

    A class that inherits from it ignores what it does not override.
    """

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        return

    def update(self, view: RigView) -> None:
        """Shows the current state; called some twenty times a second."""
        return

    def estimate(self, report: EstimateReport) -> None:
        """Shows one estimate."""
        return

    def note(self, text: str) -> None:
        """Shows a message once. May be called from any thread."""
        ...

    def close(self, view: RigView) -> int:
        """Shows the summary; returns the number of lines that a program was to read and that are lost."""
        ...
