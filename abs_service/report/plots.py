"""Empty figures in the style of the reports."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure(width: float, height: float) -> "Figure":
    """An empty figure of the given width and height [inch]."""
    from matplotlib.figure import Figure  # noqa: PLC0415  takes half a second, so only when drawing

    return Figure(figsize=(width, height), layout="constrained")
