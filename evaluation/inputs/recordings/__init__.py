"""Tracking of recordings of real sensors; recordings that are not in the data folder are skipped."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from abs_service.report.content import Section
from drivers.encoding.foreign_recording import ForeignRecordingError
from evaluation.experiment import Context, Findings, UnavailableError
from evaluation.inputs.recordings import azure, sigma_report, toy, toy_report

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "Real recordings: a soft toy (PrimeSense type), an ifm O3R and an Azure Kinect"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        toy_frames: of the toy's sequence, from the first one on.
        o3r_folds: of the ten-fold cross-validation over the O3R's pixels, at most 10.
    """

    toy_frames: int = 120
    o3r_folds: int = 5


QUICK = Settings(toy_frames=6, o3r_folds=1)


def run(settings: Settings, context: Context) -> Findings:
    """Evaluates every available recording.

    Raises:
        UnavailableError: there is none.
    """
    if context.data is None:
        raise UnavailableError(f"needs --data DIR, a folder with {', '.join(_FOLDERS)}")
    parts: dict[str, Callable[[Path], Findings]] = {
        toy.FOLDER: lambda folder: toy_report.findings(folder, settings.toy_frames, context.seed, context.progress),
        sigma_report.FOLDER: lambda folder: sigma_report.findings(folder, context.seed, settings.o3r_folds),
        azure.FOLDER: azure.findings,
    }
    found = []
    for name, measure in parts.items():
        context.progress(name)
        found.append(_part(context.data / name, measure))
    if not any(part.goals for part in found):
        raise UnavailableError(f"--data {context.data} has none of {', '.join(_FOLDERS)} that could be read")
    return Findings(
        tuple(goal for part in found for goal in part.goals),
        tuple(section for part in found for section in part.sections),
        {name: value for part in found for name, value in part.values.items()},
    )


_FOLDERS = (toy.FOLDER, sigma_report.FOLDER, azure.FOLDER)


def _part(folder: Path, measure: Callable[[Path], Findings]) -> Findings:
    """Findings of one recording, or a section that it is missing."""
    if not folder.is_dir():
        return Findings((), (Section(folder.name, (f"{folder.name} is not in the data folder.",)),))
    try:
        return measure(folder)
    except ForeignRecordingError as error:
        return Findings((), (Section(folder.name, (f"{folder.name} cannot be read: {error}",)),))
