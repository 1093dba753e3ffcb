"""Tracking of recordings of real sensors; recordings that are not in the data folder are skipped.

Statistics and goals:

- toy: median of the frames of the residual, forward and backward at most 1.2 mm, 85 % of the mask covered; TRACKING in
  95 % of the frames of every dropout; as usual again within 3 frames after one second without any;
- sponge: median residuals 0.6 mm; in the worst frame 0.5 % of the faces folded and edges changed by 8 % (95th
  percentile); corners drift by 0.7 px;
- paper: over eight cells, median frame at most 3 mm, worst 15 mm, 85 to 99 % of the points in their 95 % region, no
  frame TRACKING and wrong;
- O3R: held-out log-likelihood with factor and floor not below the others; 90 % within 1.96 σ;
- Azure Kinect: colours meet amplitudes 1.3 times as well as when moved by 8 px; median residual within the assumed σ.

Seeds: the context's, of the search.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from abs_service.report.content import Section
from drivers.encoding.foreign_recording import ForeignRecordingError
from drivers.image_folder.listing import ImageFolderError
from evaluation.experiment import Context, Findings, UnavailableError
from evaluation.inputs.recordings import azure, kinect_paper, kinect_paper_report, sigma_report
from evaluation.inputs.recordings.toy import sponge_report, toy, toy_report

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "Real recordings: a soft toy and a sponge (PrimeSense type), paper (Kinect v1), an ifm O3R, an Azure Kinect"


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        toy_frames: of the toy's sequence, from the first one on.
        sponge_frames: of the same sequence, to track the sponge alone.
        paper_frames: of the 16 frames of the sheet of paper with a truth, from the first one on; at least 2.
        paper_cells: of the 8 ways to track it.
        o3r_folds: of the ten-fold cross-validation over the O3R's pixels, at most 10.
    """

    toy_frames: int = 120
    sponge_frames: int = 120
    paper_frames: int = 16
    paper_cells: int = 8
    o3r_folds: int = 5


QUICK = Settings(toy_frames=6, sponge_frames=6, paper_frames=2, paper_cells=2, o3r_folds=1)


def run(settings: Settings, context: Context) -> Findings:
    """Evaluates every available recording.

    Raises:
        UnavailableError: there is none.
    """
    if context.data is None:
        raise UnavailableError(f"needs --data DIR, a folder with {', '.join(_FOLDERS)}")
    found = []
    for name, (folder, measure) in _parts(settings, context).items():
        context.progress(name)
        found.append(_part(name, context.data / folder, measure))
    if not any(part.goals for part in found):
        raise UnavailableError(f"--data {context.data} has none of {', '.join(_FOLDERS)} that could be read")
    return Findings(
        tuple(goal for part in found for goal in part.goals),
        tuple(section for part in found for section in part.sections),
        {name: value for part in found for name, value in part.values.items()},
    )


_FOLDERS = (toy.FOLDER, kinect_paper.FOLDER, sigma_report.FOLDER, azure.FOLDER)

_Measure = Callable[[Path], Findings]


def _parts(settings: Settings, context: Context) -> dict[str, tuple[str, _Measure]]:
    """Folder and measurement of every part by its name."""
    say, paper = context.progress, (settings.paper_frames, settings.paper_cells)
    return {
        "Soft toy": (
            toy.FOLDER,
            lambda folder: toy_report.findings(folder, settings.toy_frames, context.seed, say),
        ),
        "Sponge": (toy.FOLDER, lambda folder: sponge_report.findings(folder, settings.sponge_frames, say)),
        "Kinect v1": (kinect_paper.FOLDER, lambda folder: kinect_paper_report.findings(folder, *paper, say)),
        "ifm O3R": (
            sigma_report.FOLDER,
            lambda folder: sigma_report.findings(folder, context.seed, settings.o3r_folds),
        ),
        "Azure Kinect": (azure.FOLDER, azure.findings),
    }


def _part(name: str, folder: Path, measure: _Measure) -> Findings:
    """Findings of one recording, or a section that it is missing."""
    if not folder.is_dir():
        return Findings((), (Section(name, (f"{folder.name} is not in the data folder.",)),))
    try:
        return measure(folder)
    except (ForeignRecordingError, ImageFolderError, FileNotFoundError) as error:
        return Findings((), (Section(name, (f"{folder.name} cannot be read: {error}",)),))
