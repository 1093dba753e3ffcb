"""One sentence on images of which none shows the board: their number, and the reasons by frequency."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.calibration.shots.shots import Shot
from calib.board.april_grid import AprilGrid
from calib.board.corners import errors
from calib.board.corners.search import find
from calib.board.corners.to_8bit import grey
from calib.board.target import Charuco, Chessboard, Target

_WORDS = {
    errors.NothingFoundError: "nothing found",
    errors.MirroredBoardError: "mirrored",
    errors.SaturatedError: "saturated",
    errors.TooSmallError: "too small",
    errors.CutOffError: "cut off by the border",
    errors.BlurredError: "blurred",
    errors.MovedError: "moved since the image before",
}

#: What to do about stills, which seem to move when they are given the times of a film.
STILLS = "If these are single photographs, give them times of their own: abs-service import … --rate 1"


def reason(target: Target, seen: BoardObservations, last: Shot) -> str:
    """Reasons for which the board was found in no image, as a sentence.

    Args:
        target: the board.
        seen: observations without any corners.
        last: one of the shots, in which boards of similar sizes are looked for.
    """
    count = len(seen.rejected)
    parts = reasons(seen.rejected.values())
    advice = f". {STILLS}" if mostly_moved(seen) else ""
    like = _similar(target, last)
    found = f". Image {last.number} shows {like}: correct the description of the board" if like else ""
    return f"no {_name(target)} in any of {count} images: {parts}{found}{advice}"


def mostly_moved(seen: BoardObservations) -> bool:
    """True if most rejected images seem to show a board that moves."""
    moved = sum(isinstance(error, errors.MovedError) for error in seen.rejected.values())
    return 2 * moved > len(seen.rejected)


def reasons(errors_: Iterable[Exception]) -> str:
    """Reasons for which images were not used, the most frequent first; "" without any."""
    counts = Counter(_WORDS[type(error)] for error in errors_)
    return ", ".join(f"{words} in {number}" for words, number in counts.most_common())


def _name(target: Target) -> str:
    if isinstance(target, Chessboard):
        return f"board of {target.columns} × {target.rows} inner corners"
    if isinstance(target, AprilGrid):
        return f"AprilGrid of {target.columns} × {target.rows} tags"
    kind = "ChArUco of {} × {} squares" if isinstance(target, Charuco) else "grid of {} × {} discs"
    return kind.format(target.columns, target.rows)


def _similar(target: Target, last: Shot) -> str:
    """A chessboard of nearly this size, such as one whose squares were counted instead of its corners; "" if none."""
    if not isinstance(target, Chessboard):
        return ""
    changes = ((-1, -1), (1, 1), (-1, 0), (0, -1), (1, 0), (0, 1))
    sizes = [(target.columns + dx, target.rows + dy) for dx, dy in changes]
    for columns, rows in ((c, r) for c, r in sizes if min(c, r) >= 3):
        other = replace(target, columns=columns, rows=rows)
        if any(len(find(other, grey(look.image))[0]) for look in last.sensor_shots.values() if look.image.size):
            return f"a {_name(other)}"
    return ""
