"""E4 and E5 on a checker board: black and white are mixed everywhere, so the bias of the black nearly cancels.

Statistic, goals and seeds: those of `comparison`.
"""

import numpy as np

from evaluation.experiment import Context, Findings
from evaluation.paper.flat_boards import comparison
from evaluation.paper.flat_boards.comparison import QUICK, Board, Settings, board_print, texel_positions
from evaluation.paper.flat_boards.report import Published

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "E4 and E5: a flat checker board under a bias that depends on the amplitude"

#: Edge of a square [m].
SQUARE_M = 0.05

_ACROSS, _DOWN = texel_positions()

BOARD = Board(
    "checker board",
    board_print((np.floor(_ACROSS / SQUARE_M) + np.floor(_DOWN / SQUARE_M)) % 2 == 0),
    Published((0.16, 0.11), (0.12, 0.09)),
    {"FlexPad": 0.16 / 0.12, "NURBS": 1.0},
)


def run(settings: Settings, context: Context) -> Findings:
    """Tracks the board with NURBS and FlexPad, with the Euclidean fitness and the likelihood."""
    return comparison.run(BOARD, settings, context)
