"""Plots of a solved calibration: uncertainty over the image, difference of the halves, views, distances."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from abs_service.report import plots
from calib.solve.rounding import rounded
from calib.solve.solution import ViewFit
from calib.solve.validation.cross_validation import Agreement
from calib.solve.validation.projection_uncertainty import UncertaintyMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNSEEN = "0.8"


def uncertainty_map(field: UncertaintyMap, label: str) -> "Figure":
    """Standard deviation of projections over an image; hatched where no board was seen."""
    figure = plots.figure(7.5, 5.4)
    axes = figure.add_subplot()
    u, v = field.pixels[..., 0], field.pixels[..., 1]
    inside = field.deviations[field.inside & np.isfinite(field.deviations)]
    top = float(np.percentile(inside, 98)) if inside.size else 1.0
    values = np.ma.masked_invalid(np.minimum(field.deviations, 3 * top))
    axes.set_facecolor(_UNSEEN)
    shown = axes.contourf(u, v, values, levels=np.linspace(0, 3 * top or 1.0, 25), cmap="magma_r")
    if not field.inside.all():
        axes.contourf(u, v, field.inside.astype(float), levels=[-0.5, 0.5], colors="none", hatches=["//"])
    figure.colorbar(shown, ax=axes, label=label)
    axes.set(xlabel="u [px]", ylabel="v [px]", ylim=(float(v.max()), 0), aspect="equal")
    return figure


def cross_validation(agreement: Agreement) -> "Figure":
    """Difference between the projections of the two halves, as arrows over the image."""
    figure = plots.figure(7.5, 5.4)
    axes = figure.add_subplot()
    u, v = agreement.pixels[..., 0], agreement.pixels[..., 1]
    du, dv = agreement.differences[..., 0], agreement.differences[..., 1]
    unit = max(agreement.difference_px, 1e-6)
    arrows = axes.quiver(u, v, du, dv, angles="xy", scale_units="xy", scale=unit / (0.04 * float(u.max())), width=0.003)
    plots.key_of_arrows(figure, axes, arrows, unit)
    axes.set_title(
        f"{agreement.of}: {rounded(agreement.difference_px)} px, predicted {rounded(agreement.predicted_px)} px",
        loc="left", fontsize="medium",
    )  # fmt: skip
    axes.set(xlabel="u [px]", ylabel="v [px]", ylim=(float(v.max()), 0), aspect="equal")
    return figure


def view_errors(views: Sequence[ViewFit], unit: str, scale: float) -> "Figure":
    """Root mean square of every view; views with outliers in another colour."""
    figure = plots.figure(8, 3.2)
    axes = figure.add_subplot()
    colors = ["tab:orange" if view.outliers.any() else "tab:blue" for view in views]
    axes.bar([str(view.shot) for view in views], [view.rms * scale for view in views], color=colors)
    axes.set(xlabel="shot (orange: with outliers)", ylabel=f"root mean square [{unit}]")
    axes.tick_params(axis="x", labelsize=7, labelrotation=90)
    return figure


def distance_errors(views: Sequence[ViewFit], distances: Mapping[int, float]) -> "Figure":
    """Residual distances on boards, over the image and over the board's distance.

    Args:
        views: distances of one sensor.
        distances: of the boards by shot [m].
    """
    figure = plots.figure(11, 4.2)
    image, plot = figure.subplots(1, 2)
    pixels = np.concatenate([view.pixels for view in views])
    residuals = np.concatenate([view.residuals for view in views]) * 1e3
    reach = float(np.percentile(np.abs(residuals), 97)) or 1.0
    shown = image.scatter(*pixels.T, c=residuals, s=4, cmap="RdBu_r", vmin=-reach, vmax=reach)
    figure.colorbar(shown, ax=image, label="predicted less measured [mm]")
    image.set(xlabel="u [px]", ylabel="v [px]", aspect="equal")
    image.invert_yaxis()
    where = [distances[view.shot] for view in views]
    means = [float(np.mean(view.residuals)) * 1e3 for view in views]
    spread = [float(np.std(view.residuals)) * 1e3 for view in views]
    plot.errorbar(where, means, spread, fmt="o", markersize=4, linewidth=0.8)
    plot.axhline(0, color="0.6", linewidth=0.8)
    plot.set(xlabel="distance of the board [m]", ylabel="mean and deviation of a view [mm]")
    return figure
