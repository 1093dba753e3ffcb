"""Plots of a sensor's noise: over distance and amplitude as in Fig. 8 of the paper, and residuals."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from abs_service.calibration.noise.measurement import NoiseCalibration
from abs_service.report import plots
from calib.noise.base import DepthNoise
from calib.sequences.reference import Kind

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Number of distances and amplitudes at which a model is plotted.
_FINE = 120

#: Range of the histogram in deviations; larger residuals are clipped.
_EDGE = 5.0


def over_distance_and_amplitude(found: NoiseCalibration) -> "Figure":
    """σ, and μ if known, of the middle pixel by the model, with the measurements of every sequence as dots."""
    return _maps(found) if np.isfinite(found.amplitudes[0]) else _curves(found)


def histogram(found: NoiseCalibration) -> "Figure":
    """Normalised held-out residuals against the normal distribution."""
    figure = plots.figure(7.5, 3.6)
    axes = figure.add_subplot()
    axes.hist(np.clip(found.z, -_EDGE, _EDGE), 101, density=True, color="0.75", label="held out")
    z = np.linspace(-_EDGE, _EDGE, 400)
    axes.plot(z, np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi), color="tab:blue", label="N(0, 1)")
    for edge in (-1.96, -1, 1, 1.96):
        axes.axvline(edge, color="0.5", linewidth=0.7, linestyle=":")
    axes.set(xlabel=f"(measured − real − μ) / σ; beyond ±{_EDGE:g} at the edge", yticks=[], xlim=(-_EDGE, _EDGE))
    axes.legend()
    return figure


def _maps(found: NoiseCalibration) -> "Figure":
    """σ and μ as colour maps over distance and amplitude."""
    near, far = found.distances
    faint, bright = (max(value, 1.0) for value in found.amplitudes)
    x, a = np.meshgrid(np.linspace(near, far, _FINE), np.geomspace(faint, bright, _FINE))
    sigma, mu = _middle(found.model, found, x.ravel(), a.ravel())
    rows = [row for _, row in found.rows]
    dots = [(row.distance, row.amplitude, np.hypot(row.temporal, _known(row.fixed)), row.offset) for row in rows]
    shown = [("σ [mm]", sigma, [dot[2] for dot in dots], "viridis", (0.0, float(sigma.max()) * 1e3))]
    if found.kind.tells_offset:
        reach = float(np.abs(mu).max()) * 1e3 or 1.0
        shown.append(("μ [mm]", mu, [dot[3] for dot in dots], "RdBu_r", (-reach, reach)))
    figure = plots.figure(5.5 * len(shown), 4.2)
    for axes, (label, values, measured, colors, (low, high)) in zip(_row(figure, len(shown)), shown):
        image = values.reshape(x.shape) * 1e3
        mesh = axes.pcolormesh(x, a, image, cmap=colors, vmin=low, vmax=high, shading="gouraud", rasterized=True)
        axes.scatter(
            [dot[0] for dot in dots], [dot[1] for dot in dots], c=np.array(measured) * 1e3,
            cmap=colors, vmin=low, vmax=high, edgecolor="white", s=60,
        )  # fmt: skip
        axes.set(yscale="log", xlabel="distance [m]", ylabel="amplitude")
        figure.colorbar(mesh, ax=axes, label=f"{label}; dots: measured")
    return figure


def _curves(found: NoiseCalibration) -> "Figure":
    """σ and μ over distance, without amplitudes."""
    x = np.linspace(*found.distances, _FINE)
    sigma, mu = _middle(found.model, found, x, np.zeros(_FINE))
    known = found.kind.tells_offset
    figure = plots.figure(5.5 * (1 + known), 4.2)
    axes = _row(figure, 1 + known)
    distance = [row.distance for _, row in found.rows]
    axes[0].plot(x, sigma * 1e3, color="tab:blue", label="model, all of it")
    axes[0].plot(distance, [row.temporal * 1e3 for _, row in found.rows], "o", color="tab:orange", label="temporal")
    if found.kind is not Kind.MEAN:
        axes[0].plot(
            distance, [row.fixed * 1e3 for _, row in found.rows], "s", color="tab:green", label="fixed pattern"
        )
    if found.steps.growth > 0:
        axes[0].plot(x, found.steps.at(x) * 1e3, ":", color="0.5", label="steps of the distances")
    axes[0].set(xlabel="distance [m]", ylabel="σ [mm]", ylim=(0, None))
    axes[0].legend()
    if known:
        axes[1].plot(x, mu * 1e3, color="tab:blue")
        axes[1].plot(distance, [row.offset * 1e3 for _, row in found.rows], "o", color="tab:orange")
        axes[1].set(xlabel="distance [m]", ylabel="μ [mm]")
    return figure


def _middle(
    model: DepthNoise, found: NoiseCalibration, x: NDArray[np.float64], a: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """σ and μ [m] of the middle pixel."""
    height, width = found.statics[0].mean.shape
    p = np.full(len(x), height // 2), np.full(len(x), width // 2)
    return model.deviation(x, a, p), model.mean(x, a, p)


def _known(value: float) -> float:
    return value if np.isfinite(value) else 0.0


def _row(figure: "Figure", n: int) -> "list[Axes]":
    return list(figure.subplots(1, n, squeeze=False)[0])
