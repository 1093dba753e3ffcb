"""Pictures that several reports share. Image axes: u to the right, v downwards, centres of pixels at integers [px]."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from abs_service.report import plots

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Maximum number of arrows; more overlap.
ARROWS = 1500

#: Parts of an image, across and down, in which views are counted.
_CELLS = 8, 6

_NO_VALUE = "0.8"  # grey of what is not known


def coverage_map(views: Sequence[NDArray[np.floating]], width: int, height: int) -> "Figure":
    """Detected corners in the image, and number of views with corners in each cell.

    Args:
        views: pixels (n, 2) of the corners of each view.
        width, height: size of the image [px].
    """
    counts = coverage_counts(views, width, height)
    figure = plots.figure(7.5, 6.1 * height / width + 0.6)
    axes = figure.add_subplot()
    shown = axes.pcolormesh(*_edges(width, height), np.where(counts > 0, counts, np.nan).T, cmap="YlGn", vmin=0)
    axes.set_facecolor(_NO_VALUE)
    for pixels in views:
        axes.plot(pixels[:, 0], pixels[:, 1], ".", markersize=2.5, color="tab:blue", alpha=0.7)
    figure.colorbar(shown, ax=axes, label="views (grey: none)")
    _as_image(axes, width, height)
    return figure


def coverage_counts(views: Sequence[NDArray[np.floating]], width: int, height: int) -> NDArray[np.int64]:
    """Number of views with corners in each cell (across, down) of an image; arguments as of `coverage_map`."""
    counts = np.zeros(_CELLS, np.int64)
    for pixels in views:
        counts += np.histogram2d(pixels[:, 0], pixels[:, 1], bins=_edges(width, height))[0] > 0
    return counts


def _edges(width: int, height: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.linspace(-0.5, width - 0.5, _CELLS[0] + 1), np.linspace(-0.5, height - 0.5, _CELLS[1] + 1)


def residual_field(pixels: NDArray[np.floating], residuals: NDArray[np.floating], width: int, height: int) -> "Figure":
    """Residuals as enlarged arrows at their place in the image, and all of them from one origin.

    Residuals of a good calibration are noise: arrows in random directions. Arrows that agree with their neighbours
    show an error of the camera model.

    Args:
        pixels: where (n, 2) [px].
        residuals: measured minus predicted (n, 2) [px].
        width, height: size of the image [px].
    """
    pixels, residuals = np.asarray(pixels, float), np.asarray(residuals, float)
    every = max(1, -(-len(pixels) // ARROWS))
    lengths = np.linalg.norm(residuals, axis=1)
    typical = float(np.sqrt(np.mean(lengths**2))) if len(lengths) else 0.0
    unit = typical or 1.0
    figure = plots.figure(11, 6.6 * height / width + 0.7)
    field, scatter = figure.subplots(1, 2, width_ratios=(7.5, 3.5))
    if len(pixels):
        arrows = field.quiver(
            *pixels[::every].T, *residuals[::every].T, lengths[::every],
            angles="xy", scale_units="xy", scale=unit / (0.03 * width), width=0.0025, cmap="viridis",
        )  # fmt: skip
        plots.key_of_arrows(figure, field, arrows, unit)
    _as_image(field, width, height)
    scatter.plot(*residuals.T, ".", markersize=2.5, color="tab:blue", alpha=0.6)
    reach = 1.05 * float(np.abs(residuals).max(initial=0.0)) or 1.0
    scatter.set(
        xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal", xlabel="along u [px]", ylabel="along v [px]"
    )
    scatter.set_title(f"root mean square {typical:.3g} px, {len(lengths)} corners", fontsize="medium")
    scatter.grid(color="0.9")
    return figure


def image_map(values: NDArray[np.floating], label: str) -> "Figure":
    """A quantity per pixel with its colour bar.

    Args:
        values: (height, width); NaN is shown in grey.
        label: quantity and unit, for the bar, which ends at the 1st and 99th percentile.
    """
    return _map(values, label, _percentiles(values), "viridis")


def difference_map(values: NDArray[np.floating], label: str) -> "Figure":
    """A signed quantity per pixel; zero is white. Arguments as of `image_map`."""
    reach = max(map(abs, _percentiles(values)))
    return _map(values, label, (-reach, reach), "RdBu_r")


def _map(values: NDArray[np.floating], label: str, limits: tuple[float, float], colors: str) -> "Figure":
    height, width = values.shape
    figure = plots.figure(7.5, 6.1 * height / width + 0.6)
    axes = figure.add_subplot()
    axes.set_facecolor(_NO_VALUE)
    finite = np.isfinite(values)
    masked = np.ma.masked_array(values, ~finite)
    shown = axes.imshow(masked, cmap=colors, vmin=limits[0], vmax=limits[1], interpolation="nearest")
    below, above = bool(np.any(values[finite] < limits[0])), bool(np.any(values[finite] > limits[1]))
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[below, above]
    bar = figure.colorbar(shown, ax=axes, label=label, extend=extend)
    if not np.all(finite):
        bar.ax.set_title(f"grey: none, {1 - finite.mean():.0%}", fontsize="small")
    _as_image(axes, width, height)
    return figure


def _percentiles(values: NDArray[np.floating]) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    low, high = np.percentile(finite, (1, 99)) if finite.size else (0.0, 1.0)
    return (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5)


def _as_image(axes: "Axes", width: int, height: int) -> None:
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal", xlabel="u [px]", ylabel="v [px]")
