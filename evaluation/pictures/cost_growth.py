"""Plots how the cost grows with vertices, population and sensors, each with the line that fits it best.

python -m evaluation.pictures.cost_growth docs/images/cost.png
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from abs_service.supervision.process_setup.process_tuning import keep_freed_memory
from evaluation.benchmarks.kernels import POPULATION, VERTICES, Case, flat_sheet, nurbs_of, seconds, whole
from evaluation.service.growth.laws import fit

ROUNDS = 150

SIDES = (10, 16, 22, 32, 45, 55, 63)
POPULATIONS = (4, 8, 16, 32, 48, 64, 96)


def by_vertices() -> dict[int, Case]:
    """Meshes of more and more vertices."""
    meshes = [flat_sheet(side) for side in SIDES]
    return {len(mesh.vertices): whole("", nurbs_of((4, 4), mesh)) for mesh in meshes}


def by_population() -> dict[int, Case]:
    """Cases of growing populations of candidates."""
    surface = nurbs_of((4, 4))
    return {size: whole("", surface, size=size) for size in POPULATIONS}


def by_sensors() -> dict[int, Case]:
    """One depth camera, two, three … of the same kind, since each kind has a cost of its own."""
    surface = nurbs_of((4, 4))
    return {count: whole("", surface, tuple(f"tof/{k}" for k in range(count))) for count in range(1, 7)}


def measured(cases: dict[int, Case]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The numbers, and the least time of each [µs], measured in turn."""
    times = np.full(len(cases), np.inf)
    for _ in range(ROUNDS):
        for place, case in enumerate(cases.values()):
            times[place] = min(times[place], *(seconds(case.call) for _ in range(3)))
    return np.array(list(cases), float), 1e6 * times


def draw(axes: Axes, label: str, cases: dict[int, Case]) -> str:
    """Plots a measurement with its line; says what the line is."""
    numbers, times = measured(cases)
    law = fit(numbers.tolist(), times.tolist())
    axes.plot(numbers, law.start + law.each * numbers, color="0.6")
    axes.plot(numbers, times, "o")
    axes.set(xlabel=label, ylabel="µs", xlim=(0, None), ylim=(0, None))
    title = f"{law.start:.0f} µs + {law.each:.3g} µs each, R² = {law.determination:.4f}"
    axes.set_title(title, fontsize="medium")
    return f"{label}: {title}"


def main() -> None:
    """Measures, and draws the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    keep_freed_memory()  # as the processes of the service do; without it, 4000 vertices take twice as long
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.6), layout="constrained")
    parts = {
        f"vertices ({POPULATION} candidates)": by_vertices,
        f"candidates ({VERTICES} vertices)": by_population,
        f"ToF cameras ({POPULATION} × {VERTICES})": by_sensors,
    }
    for place, (label, cases) in enumerate(parts.items()):
        print(draw(axes[place], label, cases()))
    figure.savefig(parser.parse_args().picture, dpi=110)


if __name__ == "__main__":
    main()
