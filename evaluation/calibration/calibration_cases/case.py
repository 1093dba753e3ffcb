"""A case that fooled the calibration, and the bench on which its user's commands are run."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import abs_service
from abs_service.calibration.files import corner_file, rig_file, target_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.provenance import Provenance
from calib.board.target import Chessboard, Target
from calib.board.views import CornerView, PlaneView
from evaluation.experiment import Goal, UnavailableError
from evaluation.scenes.boards import board_views
from evaluation.scenes.boards.board_views import Head

#: Board of `evaluation.scenes.boards.board_views`, which the simulated sets show.
BOARD = Chessboard(board_views.COLUMNS, board_views.ROWS, board_views.SQUARE)

#: Longest time that a command may take [s].
_TIMEOUT_S = 600


@dataclass(frozen=True)
class Outcome:
    """Figures and sentences of a case as they are now.

    Attributes:
        now: the figure or the sentence.
        goals: what it has to reach.
    """

    now: str
    goals: tuple[Goal, ...]


@dataclass(frozen=True)
class Said:
    """Exit code of a command, and its words on the terminal."""

    code: int
    text: str

    def count(self, *words: str) -> int:
        """Number of these words that it said."""
        return sum(word in self.text for word in words)

    def line(self, word: str) -> str:
        """The first line with a word, without further spaces; "" if there is none."""
        return next((" ".join(line.split()) for line in self.text.splitlines() if word in line), "")


@dataclass(frozen=True)
class Bench:
    """An empty folder, the recorded data, and the commands of a user.

    Attributes:
        folder: in which commands run and leave their files.
        data: recordings that are not in the repository; None without.
    """

    folder: Path
    data: Path | None

    def real(self, name: str) -> Path:
        """Folder of a recorded data set.

        Raises:
            UnavailableError: it is not there.
        """
        if self.data is None or not (self.data / name).is_dir():
            raise UnavailableError(f"needs the data set {name}")
        return self.data / name

    def run(self, *words: object) -> Said:
        """Runs `abs-service`."""
        root = str(Path(abs_service.__file__).parents[1])
        done = subprocess.run(
            [sys.executable, "-m", "abs_service", *map(str, words)],
            check=False, cwd=self.folder, env={**os.environ, "PYTHONPATH": root}, timeout=_TIMEOUT_S,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        return Said(done.returncode, done.stdout)

    def values(self, report: str) -> Mapping[str, Any]:
        """Numbers of a report by the name of its JSON file."""
        return json.loads((self.folder / report).read_text(encoding="utf-8"))["values"]

    def exists(self, name: str) -> bool:
        """True if a command left this file."""
        return (self.folder / name).exists()

    def board(self, target: Target = BOARD) -> Path:
        """Writes the description of a board."""
        path = self.folder / "board.toml"
        target_file.write(target, path)
        return path

    def save(
        self, name: str, heads: Mapping[str, Head], corners: Sequence[CornerView], planes: Sequence[PlaneView] = ()
    ) -> Path:
        """Writes views as the corners that a user's command saves, and the description of their board."""
        self.board()
        path = self.folder / f"{name}.corners.npz"
        sizes = {name: (head.camera.width, head.camera.height) for name, head in heads.items()}
        corner_file.write(BoardObservations(tuple(corners), tuple(planes), {}, sizes), path)
        return path

    def store(self, name: str, heads: Mapping[str, Head]) -> Path:
        """Writes the true cameras as a calibration."""
        path = self.folder / f"{name}.toml"
        sensors = {
            sensor: rig_file.SensorCalibration(
                head.camera, residuals=rig_file.Residuals(corners_px=head.corner_sigma * 2**0.5 or None)
            )
            for sensor, head in heads.items()
        }
        rig_file.write(rig_file.RigCalibration(name, sensors, Provenance("simulated", "2026-11-28"), "good"), path)
        return path


@dataclass(frozen=True)
class Case:
    """A case of the table.

    Attributes:
        name: what was done, as the first cell of its row.
        before: figures and words of commit 943c478; "–" where nothing was measured.
        measure: does it again.
        brief: True if it is part of the quick form.
    """

    name: str
    before: str
    measure: Callable[[Bench], Outcome]
    brief: bool = True
