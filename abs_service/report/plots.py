"""What every drawn picture begins with."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure(width: float, height: float) -> "Figure":
    """An empty figure of so many inches."""
    from matplotlib.figure import Figure  # noqa: PLC0415  half a second that only those pay who draw

    return Figure(figsize=(width, height), layout="constrained")
