"""What the choice of a noise model is worth to the tracker: the table of docs/noise.md.

  python -m tests.evaluation.noise_tracking

The demo rig's sheet, 300 exposures for each of three seeds, offline, with other models of the time-of-flight noise.
"""

import dataclasses

import numpy as np

from abs_service.tracking import Tracking
from calib.noise.base import DepthNoise
from calib.noise.constant import Constant
from calib.noise.tof_amplitude import TofAmplitude
from calib.rig import Rig
from drivers.simulated.time_of_flight import TimeOfFlightNoise
from tests.tracker.driving import default_plan, drive, mean_errors, rig_of, simulate

SEEDS = (1, 2, 3)
TRUE = TimeOfFlightNoise()
LAW = TofAmplitude((TRUE.sigma_offset, TRUE.sigma_distance), TRUE.sigma_amplitude)


def scaled(factor: float) -> TofAmplitude:
    """The true law with another deviation."""
    powers = tuple(factor * value for value in LAW.sigma)
    return dataclasses.replace(LAW, sigma=powers, sigma_amplitude=factor * LAW.sigma_amplitude)


MODELS: dict[str, DepthNoise] = {
    "tof_amplitude, the simulator's law": LAW,
    "constant, 4.5 mm": Constant(4.5e-3),
    "half the law's deviation": scaled(0.5),
    "twice the law's deviation": scaled(2.0),
}


def with_noise(rig: Rig, noise: DepthNoise) -> Rig:
    """The rig with another noise model of its time-of-flight sensor."""
    tof = dataclasses.replace(rig.sensors["tof"], noise=noise)
    return dataclasses.replace(rig, sensors={**rig.sensors, "tof": tof})


def row(name: str, noise: DepthNoise | None) -> str:
    """One line of the table; None for the rig's own model."""
    cells, variances = [], []
    for seed in SEEDS:
        simulation = simulate(f"simulated://sheet?seed={seed}")
        rig = rig_of(simulation)
        tracking = Tracking(rig if noise is None else with_noise(rig, noise), default_plan())
        steps = list(drive(tracking, simulation, range(300)))
        cells.append("{:.2f} ({:.2f})".format(*mean_errors(steps)))
        fits = [fit for step in steps for fit in step.estimate.fits if fit.sensor == "tof"]
        variances.append(np.mean([fit.normalized_residual**2 for fit in fits]))
    return f"| {name} | {' | '.join(cells)} | {np.mean(variances):.2f} |"


def main() -> None:
    """Prints the table."""
    print("| noise model of the depth | seed 1 | seed 2 | seed 3 | variance of the residuals |")
    print("|---|---|---|---|---|")
    print(row("the demo's gaussian_polynomial", None))
    for name, noise in MODELS.items():
        print(row(name, noise), flush=True)


if __name__ == "__main__":
    main()
