"""How well fitted noise models say what a sensor does: the table of docs/noise.md.

  python -m evaluation.calibration.noise_fits

Samples are those of `tests/calib/laws.py`: the simulator's laws, 20 000 samples of which 5 % come from anywhere; as
many others are held out. Errors are the largest over the domain, the worst of ten seeds; all else is their mean.
"""

import numpy as np

from calib.noise import constant, gaussian_polynomial, structured_light, tof_amplitude
from calib.noise.fit.quality import goodness_of_fit
from tests.calib import laws

SEEDS = range(10)
OUTLIERS = 0.05
FITS = {
    "constant": constant.fit,
    "gaussian_polynomial, σ and μ of degree 1 in x": lambda samples: gaussian_polynomial.fit(samples, (1, 0), (1, 0)),
    "gaussian_polynomial, and of degree 3 in a": lambda samples: gaussian_polynomial.fit(samples, (1, 3), (1, 3)),
    "tof_amplitude": tof_amplitude.fit,
}


def time_of_flight(fit) -> list[float]:
    """Errors of σ [%] and μ [mm], and held-out log-likelihood, variance and coverage, over the seeds."""
    (x, a), rows = laws.grid(), []
    p = laws.somewhere(len(x))
    for seed in SEEDS:
        model = fit(laws.time_of_flight(seed, outliers=OUTLIERS))
        quality = goodness_of_fit(model, laws.time_of_flight(seed + 100, outliers=OUTLIERS))
        sigma = np.abs(model.deviation(x, a, p) / laws.TOF.sigma(x, a) - 1).max() * 100
        mean = np.abs(model.mean(x, a, p) - laws.TOF.mu(x, a)).max() * 1e3
        rows.append([sigma, mean, *_told(quality)])
    return _over_seeds(rows)


def kinect() -> list[float]:
    """The same for structured light, which has no mean offset."""
    x, rows = np.linspace(0.6, 3.5, 100), []
    for seed in SEEDS:
        model = structured_light.fit(laws.structured_light(seed, outliers=OUTLIERS), laws.KINECT.step)
        quality = goodness_of_fit(model, laws.structured_light(seed + 100, outliers=OUTLIERS))
        sigma = model.deviation(x, x, laws.somewhere(100)) / laws.structured_light_deviation(x)
        rows.append([np.abs(sigma - 1).max() * 100, 0.0, *_told(quality)])
    return _over_seeds(rows)


def _told(quality) -> list[float]:
    return [quality.log_likelihood, quality.variance, quality.within_one, quality.within_95, quality.outlier_share]


def _over_seeds(rows: list[list[float]]) -> list[float]:
    values = np.array(rows)
    return [*values[:, :2].max(axis=0), *values[:, 2:].mean(axis=0)]


def main() -> None:
    """Prints the table."""
    print(
        "| sensor | model | error of σ % | of μ mm | log-likelihood | variance | within σ | within 1.96 σ | outliers |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    found = {("time of flight", name): time_of_flight(fit) for name, fit in FITS.items()}
    found["structured light", "structured_light"] = kinect()
    for (sensor, name), (sigma, mean, *rest) in found.items():
        told = " | ".join(f"{value:.3f}" for value in rest)
        print(f"| {sensor} | {name} | {sigma:.1f} | {mean:.2f} | {told} |")


if __name__ == "__main__":
    main()
