"""Findings on the σ that the O3R reports for every pixel."""

from pathlib import Path

import numpy as np

from abs_service.report.content import Column, Section, Table
from calib.noise.base import DepthNoise
from calib.noise.constant import Constant
from calib.noise.measured import Measured
from evaluation.experiment import Findings, at_least
from evaluation.inputs.recordings import sigma_image
from evaluation.inputs.recordings.sigma_image import CLAIMED, FITTED, ONE, Row

FOLDER = "tof_ifm_o3r"

_COLUMNS = (
    Column("noise model"),
    Column("parameters"),
    Column("pixels", format="d"),
    Column("log-likelihood", "nats a pixel", ".3f"),
    Column("variance", format=".2f"),
    Column("within σ", format=".3f"),
    Column("within 1.96 σ", format=".3f"),
    Column("outliers", format=".3f"),
)


def findings(folder: Path, seed: int, rounds: int) -> Findings:
    """Held-out likelihood and coverage with the sensor's own σ, with factor and floor, and with one σ for all."""
    rows = {
        row.name: row for row in sigma_image.compared(sigma_image.read(folder), np.random.default_rng(seed), rounds)
    }
    table = Table("Pixels that the tracker did not see, with its mesh as the true surface", _COLUMNS, _cells(rows))
    gain = rows[FITTED].quality.log_likelihood - rows[ONE].quality.log_likelihood
    raw = rows[FITTED].quality.log_likelihood - rows[CLAIMED].quality.log_likelihood
    text = (
        "The sensor's deviations are those of repeated measurements. In one frame, pixels differ from the surface by "
        "what is fixed as well: the pattern of single pixels, and relief finer than the mesh. Factor and floor tell "
        "how much of it the σ image explains: a factor near 0 says that what it claims has nothing to do with it."
    )
    return Findings(
        (
            at_least("O3R: held-out log-likelihood, own σ with factor and floor − one σ for all", gain, 0.0, "nats"),
            at_least("O3R: held-out log-likelihood, own σ with factor and floor − own σ as it is", raw, 0.0, "nats"),
            at_least("O3R: share within 1.96 σ, own σ with factor and floor", rows[FITTED].quality.within_95, 0.9),
        ),
        (Section("ifm O3R: the sensor's own σ", (text, table)),),
        {"o3r": {name: numbers(row) for name, row in rows.items()}},
    )


def numbers(row: Row) -> dict[str, float]:
    """A row's numbers by name, in the order of the table."""
    found = row.quality
    return {
        "log_likelihood": found.log_likelihood,
        "variance": found.variance,
        "within_one": found.within_one,
        "within_95": found.within_95,
        "outlier_share": found.outlier_share,
    }


def _cells(rows: dict[str, Row]) -> tuple[tuple[str | float, ...], ...]:
    return tuple((row.name, _parameters(row.model), row.pixels, *numbers(row).values()) for row in rows.values())


def _parameters(model: DepthNoise) -> str:
    match model:
        case Measured():
            return f"factor {model.factor:.3g}, floor {model.floor * 1e3:.2f} mm"
        case Constant():
            return f"{model.sigma * 1e3:.2f} mm"
    return ""
