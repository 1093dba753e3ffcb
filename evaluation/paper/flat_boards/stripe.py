"""E4 and E5 on a white board with a black centre, the worst case: the bias of the black bends the board.

Statistic, goals and seeds: those of `comparison`.
"""

import numpy as np

from evaluation.experiment import Context, Findings
from evaluation.paper.flat_boards import comparison
from evaluation.paper.flat_boards.comparison import QUICK, WIDTH, Board, Settings, board_print, texel_positions
from evaluation.paper.flat_boards.report import Published

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "E4 and E5: a flat white board with a black centre under a bias that depends on the amplitude"

BOARD = Board(
    "stripe board",
    board_print(np.abs(texel_positions()[0] - WIDTH / 2) < WIDTH / 6),
    Published((0.92, 0.23), (0.24, 0.17)),
    {"FlexPad": 3.8, "NURBS": 2.0},
)


def run(settings: Settings, context: Context) -> Findings:
    """Tracks the board, the middle third of which is black, with NURBS and FlexPad and with both fitness functions."""
    return comparison.run(BOARD, settings, context)
