"""Curves of the last minute."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from abs_service.display.page.numbers import MINUTE_S, Numbers

#: Values of each half second, by name; NaN where there are none.
Curves = Mapping[str, NDArray[np.float64]]

#: Points of a curve: one each half second. Components of theta that are shown.
STEPS, COMPONENTS = round(2 * MINUTE_S), 5


def plots(numbers: Sequence[Numbers], sigmas: Mapping[str, NDArray[np.float64]], now_s: float) -> dict[str, Curves]:
    """Curves by title; each point is the mean of half a second.

    Args:
        numbers: of the last minute, oldest first.
        sigmas: arrival [s] and σ [mm] (n, 2) of vertices, by name.
        now_s: monotonic time [s].
    """
    times_s = np.array([one.t_s for one in numbers]) - now_s
    sensors = sorted({name for one in numbers for name in one.likelihoods})
    values: dict[str, dict[str, Sequence[float] | NDArray[np.floating]]] = {
        "latency [ms]": {"age": [one.age_ms for one in numbers], "search": [one.solve_ms for one in numbers]},
        "generations": {"generations": [one.generations for one in numbers]},
        "log-likelihood of a vertex": {
            name: [one.likelihoods.get(name, np.nan) for one in numbers] for name in sensors
        },
        "σ of a vertex, median [mm]": {"σ": [one.deviation_mm for one in numbers]},
        "Θ from its mean, components that move most [SI]": dict(moving(numbers)),
    }
    means: dict[str, Curves] = {
        title: {name: binned(times_s, column) for name, column in curves.items()}
        for title, curves in values.items()
        if curves
    }
    rates: dict[str, Curves] = {
        "estimates a second": {"rate": a_second(times_s, np.ones(len(numbers)))},
        "lost a second": {name: a_second(times_s, amounts) for name, amounts in lost(numbers).items()},
    }
    chosen = {name: binned(column[:, 0] - now_s, column[:, 1]) for name, column in sigmas.items()}
    found = {"latency [ms]": means.pop("latency [ms]")} | rates | means
    if chosen:
        found["σ of the followed vertices [mm]"] = chosen
    return {title: _known(curves) for title, curves in found.items()}


def _known(curves: Curves) -> Curves:
    """Curves with a value, all if none has one: one without would hide the others, as the ages of a replay do."""
    return {name: curve for name, curve in curves.items() if np.isfinite(curve).any()} or curves


def lost(numbers: Sequence[Numbers]) -> dict[str, NDArray[np.floating]]:
    """Losses between an estimate and the next one, by component; of all together if none has lost anything.

    Args:
        numbers: estimates (n), oldest first.
    """
    names = sorted({name for one in numbers for name, number in one.lost.items() if number})
    found = {}
    for name in names:
        counted = np.array([one.lost.get(name, 0) for one in numbers])
        found[name] = np.maximum(np.diff(counted, prepend=counted[:1]), 0)  # a process that begins anew counts from 0
    return found or {"all": np.zeros(len(numbers))}


def moving(numbers: Sequence[Numbers]) -> dict[str, NDArray[np.floating]]:
    """The components of theta that move most, each less its mean, by name; NaN where the model was another.

    Args:
        numbers: estimates (n), oldest first; the last one says which model.
    """
    if not numbers:
        return {}
    last = numbers[-1]
    theta = np.full((len(numbers), len(last.theta)), np.nan)
    same = [one.model_id == last.model_id and one.theta.shape == last.theta.shape for one in numbers]
    theta[same] = [one.theta for one, kept in zip(numbers, same) if kept]
    theta -= np.mean(theta[same], axis=0)
    most = np.sort(np.argsort(-np.std(theta[same], axis=0), kind="stable")[:COMPONENTS])
    return {f"Θ{index}": theta[:, index] for index in most}


def binned(times_s: NDArray[np.float64], values: Sequence[float] | NDArray[np.floating]) -> NDArray[np.float64]:
    """Means of values in half seconds of the last minute, NaN where there are none.

    Args:
        times_s: of the values, before now (n,) [s], so negative.
        values: (n,); NaN are left out.
    """
    total, count = _sums(times_s, np.asarray(values, float))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def a_second(times_s: NDArray[np.float64], amounts: NDArray[np.floating]) -> NDArray[np.float64]:
    """Amounts a second in half seconds of the last minute [1/s]; NaN where nothing was received yet.

    Args:
        times_s: of the amounts, before now (n,) [s], so negative.
        amounts: (n,).
    """
    total, count = _sums(times_s, amounts)
    # How much there was until half a second after the first is unknown.
    return np.where(np.cumsum(count) > count, total * STEPS / MINUTE_S, np.nan)


def _sums(times_s: NDArray[np.float64], values: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Sum and number of the values in each half second."""
    index = np.floor((times_s + MINUTE_S) * STEPS / MINUTE_S).astype(int)
    kept = (index >= 0) & (index < STEPS) & np.isfinite(values)
    count = np.bincount(index[kept], minlength=STEPS)
    return np.asarray(np.bincount(index[kept], values[kept], STEPS), np.float64), count


def complete(columns: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], ...]:
    """Times [s] and values of the half seconds in which every column has one: a plot cannot leave out values."""
    times_s = np.linspace(-MINUTE_S, 0, STEPS, endpoint=False) + 0.5 * MINUTE_S / STEPS
    kept = np.isfinite(columns).all(axis=0)
    return times_s[kept], *(column[kept] for column in columns)
