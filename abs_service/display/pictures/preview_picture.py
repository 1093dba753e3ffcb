"""Picture of a preview: depth image, selected pixels, mesh, classes of the rim, and a legend in words."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from abs_service.display.sentences import sentences
from abs_service.report import plots
from abs_service.tracker.terms.depth.outline.rim_classes import RimClass
from abs_service.tracking.preview import FoundMesh, Preview
from calib.camera import Camera

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

#: Colours of the classes of the rim, distinct for colour-blind people as well (Okabe and Ito), and of the rest.
CLASS_COLORS: Mapping[RimClass, str] = {
    RimClass.FREE: "#00b37d",
    RimClass.CONTACT: "#e69f00",
    RimClass.SILHOUETTE: "#cc5fa8",
    RimClass.OCCLUDED: "#e03c14",
    RimClass.BORDER: "#56b4e9",
}
REGION, MESH, NO_RETURN = "#f0e442", "#ffffff", "#16256e"

#: Background and text of the page, and text of warnings.
PAGE, TEXT, WARNING = "#202020", "#f2f2f2", "#ffb09c"

CLASS_WORDS: Mapping[RimClass, str] = {
    RimClass.FREE: "free edge: the object ends",
    RimClass.CONTACT: "contact: measured surface goes on",
    RimClass.SILHOUETTE: "silhouette: the surface turns away",
    RimClass.OCCLUDED: "occluded: behind something, or a hole",
    RimClass.BORDER: "border: the image ends",
}

#: Depth images are enlarged by a whole factor to at least this width [px].
MIN_WIDTH = 900

#: Height of the line of text, width of the legend, and least height beside it [px].
LINE, LEGEND, MIN_HEIGHT = 40, 390, 480

#: Room for the rows' numbers on the left of the image, and for the columns' below it [px].
LEFT, BELOW = 64, 52

#: Pixels per inch, the unit of sizes of text.
DPI = 100

#: Percentiles of the distances at the ends of the grey scale, which is robust against outliers. It ends earlier at this
#: multiple of the distance of what matters, so that a far background does not take all of its contrast.
SHOWN_PERCENT, SHOWN_BEYOND = (1, 98), 1.75

#: Grey of the nearest and of the farthest distance: dark, so that mesh and outline of a near object stand out.
NEAR, FAR = "0.3", "0.9"

#: Diameter of the rim's vertices, as a share of the mesh's edges in the picture, and its limits [px].
DOT_SHARE, DOT_LIMITS = 0.8, (6.0, 9.0)

#: Characters in a line of the legend.
LINE_LENGTH = 46


def draw(preview: Preview, tracker: str, model: str, path: Path) -> None:
    """Draws a preview in the format of the file's suffix.

    Raises:
        ValueError: no such format.
        OSError: the file cannot be written.
    """
    height, width = preview.distance.shape
    enlarged = -(-MIN_WIDTH // width)
    page = _Page(enlarged * width, enlarged * height)
    axes = page.image_axes(width, height)
    _draw_depth(page, axes, preview)
    parts: list[Artist] = []
    if preview.selected.any():
        parts.append(_draw_region(axes, preview.selected))
    if preview.found is not None:
        parts += _draw_mesh(axes, preview.found, preview.camera, enlarged)
    parts.append(_patch(NO_RETURN, f"no return: {np.isnan(preview.distance).mean():.0%} of the pixels"))
    page.write_legend(title(preview, tracker, model), parts, note(preview))
    page.figure.savefig(path, dpi=DPI)


def title(preview: Preview, tracker: str, model: str) -> str:
    """One line on the detected object: name, size and distance."""
    frame = f"frame {preview.number}"
    found = preview.found
    if found is None:
        return f"{tracker} ({model}), {frame}: nothing to track"
    length, width, height = (f"{extent * 1e3:.0f}" for extent in found.extents)
    away = float(np.median(preview.distance[preview.selected]))
    size = f"{len(found.vertices)} vertices, {length} × {width} × {height} mm"
    return f"{tracker} ({model}), {frame}: {size}, {away:.2f} m away"


def note(preview: Preview) -> str:
    """Warnings about the object, and the reason why the first frame shows none; "" without any."""
    if preview.found is None:
        return preview.reason
    late = (f"not found in the first frame: {preview.reason}",) if preview.reason else ()
    return sentences((*preview.warnings, *late))


class _Page:
    """An empty picture: a line of text above an image, and a legend on its right.

    Args:
        width, height: of the image [px].
    """

    def __init__(self, width: int, height: int) -> None:
        self._image = width, height
        self._width, self._height = LEFT + width + LEGEND, LINE + max(height, MIN_HEIGHT) + BELOW
        self.figure = plots.figure(self._width / DPI, self._height / DPI)
        self.figure.set_layout_engine("none")
        self.figure.set_facecolor(PAGE)

    def image_axes(self, columns: int, rows: int) -> "Axes":
        """Axes of an image of so many pixels, by whose numbers a region is written."""
        width, height = self._image
        axes = self.figure.add_axes(self._box(LEFT, LINE, width, height))
        axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
        axes.set_xlabel("column u [px]", color=TEXT)
        axes.set_ylabel("row v [px]", color=TEXT)
        axes.tick_params(labelsize=9, colors=TEXT)
        axes.spines[:].set_visible(False)  # they would hide an outline along the border
        return axes

    def bar_axes(self) -> "Axes":
        """Axes of a horizontal colour bar below the legend."""
        return self.figure.add_axes(self._box(LEFT + self._image[0] + 16, self._height - 62, LEGEND - 44, 12))

    def write_legend(self, line: str, parts: "list[Artist]", text: str) -> None:
        """Writes the line, the labels of what was drawn, and a text below them."""
        left, top = self._box(LEFT + self._image[0] + 12, LINE, 0, 0)[:2]
        self.figure.text(12 / self._width, 1 - LINE / 2 / self._height, line, va="center", fontsize=11, color=TEXT)
        legend = self.figure.legend(
            handles=parts, loc="upper left", bbox_to_anchor=(left, top),
            frameon=False, borderaxespad=0, fontsize=10, labelcolor=TEXT,
        )  # fmt: skip
        if text:
            below = legend.get_window_extent().y0 / self.figure.bbox.height - 20 / self._height
            lines = textwrap.fill(text, LINE_LENGTH)
            self.figure.text(left, below, lines, va="top", fontsize=10, color=WARNING)

    def _box(self, left: float, top: float, width: float, height: float) -> tuple[float, float, float, float]:
        """A box [px] from the upper left corner, in what Matplotlib calls figure coordinates."""
        below = self._height - top - height
        return left / self._width, below / self._height, width / self._width, height / self._height


def _draw_depth(page: _Page, axes: "Axes", preview: Preview) -> None:
    """Draws the depth image, near is dark, and its colour bar."""
    from matplotlib.colors import LinearSegmentedColormap  # noqa: PLC0415  takes half a second, so only when drawing

    low, high = _shown_range(preview)
    greys = LinearSegmentedColormap.from_list("distance", [NEAR, FAR]).with_extremes(bad=NO_RETURN)
    masked = np.ma.masked_invalid(preview.distance)
    shown = axes.imshow(masked, cmap=greys, vmin=low, vmax=high, interpolation="nearest")
    farthest = np.nanmax(preview.distance, initial=low)
    bar = page.figure.colorbar(
        shown, cax=page.bar_axes(), orientation="horizontal", extend="max" if farthest > high else "neither"
    )
    bar.set_label("distance [m]", fontsize=10, color=TEXT)
    bar.ax.tick_params(labelsize=9, colors=TEXT)


def _shown_range(preview: Preview) -> tuple[float, float]:
    """Distances [m] at the ends of the grey scale."""
    known = preview.distance[np.isfinite(preview.distance)]
    if not known.size:
        return 0.0, 1.0
    low, high = np.percentile(known, SHOWN_PERCENT)
    of_interest = preview.distance[preview.selected] if preview.selected.any() else known
    high = min(high, SHOWN_BEYOND * float(np.median(of_interest)))
    return float(low), max(float(high), float(low) + 1e-3)


def _draw_region(axes: "Axes", selected: NDArray[np.bool_]) -> "Artist":
    """Draws the outline of the selected pixels (height, width); returns its entry in the legend."""
    height, width = selected.shape
    columns, rows = np.arange(-1, width + 1), np.arange(-1, height + 1)
    axes.contour(columns, rows, np.pad(selected, 1).astype(float), levels=[0.5], colors=[REGION], linewidths=1.4)
    return _line(REGION, f"region: {np.count_nonzero(selected)} pixels selected", 1.4)


def _draw_mesh(axes: "Axes", found: FoundMesh, camera: Camera, enlarged: int) -> "list[Artist]":
    """Draws the mesh and its rim; returns the entries of the legend."""
    from matplotlib.collections import LineCollection  # noqa: PLC0415  takes half a second, so only when drawing

    place, edges = camera.project(found.vertices), found.mesh.edges
    sides = place[edges]
    axes.add_collection(LineCollection(list(sides), colors=MESH, linewidths=0.7, alpha=0.75))
    parts = [_line(MESH, f"mesh: {len(place)} vertices, {len(edges)} edges", 0.7)]
    length = enlarged * float(np.nanmedian(np.linalg.norm(sides[:, 0] - sides[:, 1], axis=1)))
    size = float(np.clip(DOT_SHARE * length, *DOT_LIMITS)) * 72 / DPI
    for rim_class, color in CLASS_COLORS.items():
        of_class = found.rim[found.classes == rim_class]
        style = {"color": color, "linestyle": "", "marker": "o", "markeredgecolor": "black", "markeredgewidth": 0.6}
        axes.plot(*place[of_class].T, markersize=size, **style)
        parts.append(_entry(f"{CLASS_WORDS[rim_class]} ({len(of_class)})", markersize=6, **style))
    return parts


def _line(color: str, label: str, width: float) -> "Artist":
    return _entry(label, color=color, linewidth=width)


def _entry(label: str, **style: Any) -> "Artist":
    from matplotlib.lines import Line2D  # noqa: PLC0415  takes half a second, so only when drawing

    return Line2D([], [], label=label, **style)


def _patch(color: str, label: str) -> "Artist":
    from matplotlib.patches import Patch  # noqa: PLC0415  takes half a second, so only when drawing

    return Patch(facecolor=color, label=label)
