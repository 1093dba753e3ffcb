"""Accuracy of fitted noise models: the table of docs/explanation/noise.md.

Samples are those of `noise_laws`: 20 000 from the simulator, 5 % of them uniform outliers, and as many
held out. Errors are the largest over the domain, in the worst of the seeds; all other statistics are means.

Goals: the sensor's own law is found to 10 % of σ and 1 mm of μ, in the worst of the seeds.
Seeds: ten sets of samples, 0 to 9; those held out have 100 more; the context's is not used.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from abs_service.report.content import Column, Section, Table
from calib.noise import constant, gaussian_polynomial, structured_light, tof_amplitude
from calib.noise.base import DepthNoise
from calib.noise.fit.quality import Quality, goodness_of_fit
from calib.noise.fit.samples import Samples
from evaluation.calibration import noise_laws
from evaluation.experiment import Context, Findings, at_most

TITLE = "Accuracy of fitted noise models"

OUTLIERS = 0.05
FITS: Mapping[str, Callable[[Samples], DepthNoise]] = {
    "constant": constant.fit,
    "gaussian_polynomial, σ and μ of degree 1 in x": lambda samples: gaussian_polynomial.fit(samples, (1, 0), (1, 0)),
    "gaussian_polynomial, and of degree 3 in a": lambda samples: gaussian_polynomial.fit(samples, (1, 3), (1, 3)),
    "tof_amplitude": tof_amplitude.fit,
}


def time_of_flight(fit: Callable[[Samples], DepthNoise], seeds: int) -> list[float]:
    """Largest errors of σ [%] and μ [mm] over the seeds, and means of the held-out statistics."""
    (x, a), rows = noise_laws.grid(), []
    p = noise_laws.somewhere(len(x))
    for seed in range(seeds):
        model = fit(noise_laws.time_of_flight(seed, outliers=OUTLIERS))
        quality = goodness_of_fit(model, noise_laws.time_of_flight(seed + 100, outliers=OUTLIERS))
        sigma = np.abs(model.deviation(x, a, p) / noise_laws.TOF.sigma(x, a) - 1).max() * 100
        mean = np.abs(model.mean(x, a, p) - noise_laws.TOF.mu(x, a)).max() * 1e3
        rows.append([sigma, mean, *_statistics(quality)])
    return _over_seeds(rows)


def kinect(seeds: int) -> list[float]:
    """The same for structured light, which has no mean offset."""
    x, rows = np.linspace(0.6, 3.5, 100), []
    for seed in range(seeds):
        model = structured_light.fit(noise_laws.structured_light(seed, outliers=OUTLIERS), noise_laws.KINECT.step)
        quality = goodness_of_fit(model, noise_laws.structured_light(seed + 100, outliers=OUTLIERS))
        sigma = model.deviation(x, x, noise_laws.somewhere(100)) / noise_laws.structured_light_deviation(x)
        rows.append([np.abs(sigma - 1).max() * 100, 0.0, *_statistics(quality)])
    return _over_seeds(rows)


def _statistics(quality: Quality) -> list[float]:
    return [quality.log_likelihood, quality.variance, quality.within_one, quality.within_95, quality.outlier_share]


def _over_seeds(rows: list[list[float]]) -> list[float]:
    values = np.array(rows)
    return [*values[:, :2].max(axis=0), *values[:, 2:].mean(axis=0)]


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        seeds: number of sets of samples, with the seeds 0, 1, …
    """

    seeds: int = 10


QUICK = Settings(1)

_COLUMNS = (
    Column("sensor"), Column("model"), Column("error of σ", "%", ".1f"), Column("error of μ", "mm", ".2f"),
    Column("log-likelihood", "", ".3f"), Column("variance", "", ".3f"), Column("within σ", "", ".3f"),
    Column("within 1.96 σ", "", ".3f"), Column("outliers", "", ".3f"),
)  # fmt: skip


def run(settings: Settings, context: Context) -> Findings:
    """Fits every model to every set of samples."""
    found = {}
    for name, fit in FITS.items():
        context.progress(name)
        found["time of flight", name] = time_of_flight(fit, settings.seeds)
    found["structured light", "structured_light"] = kinect(settings.seeds)
    own = (found["time of flight", "tof_amplitude"], found["structured light", "structured_light"])
    goals = (
        at_most("Error of σ of the sensor's own law, the largest", max(one[0] for one in own), 10, "%"),
        at_most("Error of μ of the sensor's own law, the largest", max(one[1] for one in own), 1, "mm"),
    )
    rows = tuple((sensor, model, *one) for (sensor, model), one in found.items())
    values = {f"{sensor}, {model}": one for (sensor, model), one in found.items()}
    return Findings(goals, (Section("Errors", (Table("Every noise model", _COLUMNS, rows),)),), values)
