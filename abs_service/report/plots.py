"""Empty figures in the style of the reports."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.quiver import Quiver

#: Height of the key of arrows, above all else in the figure [inch].
_KEY = 0.3


def figure(width: float, height: float) -> "Figure":
    """An empty figure of the given width and height [inch]."""
    from matplotlib.figure import Figure  # noqa: PLC0415  takes half a second, so only when drawing

    return Figure(figsize=(width, height), layout="constrained")


def key_of_arrows(figure: "Figure", axes: "Axes", arrows: "Quiver", length_px: float) -> None:
    """Shows above the axes how long an arrow of `length_px` [px] is, in room that the layout leaves to it."""
    height = float(figure.get_figheight())
    figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - _KEY / height))
    place = 0.85, 1.0 - 0.5 * _KEY / height
    axes.quiverkey(arrows, *place, length_px, f"{length_px:.2g} px", labelpos="E", coordinates="figure")
