"""Clauses on images that do not show the board: their number, and the reasons by frequency."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence

import numpy as np

from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.calibration.shots.shots import Shot
from calib.board.april_grid import AprilGrid
from calib.board.corners import description, errors
from calib.board.corners.other_discs import other_discs
from calib.board.corners.quality import is_saturated
from calib.board.corners.search import chessboard_size
from calib.board.corners.to_8bit import Grey, grey
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target

_WORDS = {
    errors.NothingFoundError: "nothing found",
    errors.MirroredBoardError: "mirrored",
    errors.OtherBoardError: "not as described",
    errors.SaturatedError: "saturated",
    errors.TooSmallError: "too small",
    errors.CutOffError: "cut off by the border",
    errors.HiddenError: "partly hidden",
    errors.BlurredError: "blurred",
    errors.MovedError: "moved since the image before",
}

#: Saturated part of an image that may hide a board, and the level [of 255] below which nearly all of a dark one is.
_BRIGHT, _DARK = 0.3, 16

_CORRECT = "correct the description of the board, or the images"

#: What to do about stills, which seem to move when they are given the times of a film.
STILLS = "If these are single photographs, give them times of their own: abs-service import … --rate 1"


def reason(target: Target, seen: BoardObservations, shown: Sequence[Shot]) -> str:
    """Reasons for which the board was found in no image, as a sentence.

    Args:
        target: the board.
        seen: observations without any corners.
        shown: some of the shots, in which boards are looked for that differ from the description.
    """
    count = len(seen.rejected)
    parts = reasons(seen.rejected.values())
    advice = f". {STILLS}" if mostly_moved(seen) else ""
    other = f". {said}" if (said := instead(target, shown, seen.rejected.values())) else ""
    return f"no {_name(target)} in any of {count} images: {parts}{other}{advice}"


def _advice(errors_: Collection[Exception]) -> str:
    """Sentence of the first error of the most frequent kind, if its kind alone does not say what to do; else ""."""
    (kind, _), *_ = Counter(map(type, errors_)).most_common(1)
    if kind not in (errors.OtherBoardError, errors.MirroredBoardError):
        return ""
    said = str(next(error for error in errors_ if type(error) is kind))
    return said[0].upper() + said[1:]


def looked_at(shown: Sequence[Shot], shot: Shot) -> list[Shot]:
    """The first and the last two of all shots, from those before and the next one: enough to see another board."""
    return [*shown[:1], *shown[1:][-1:], shot]


def instead(target: Target, shown: Sequence[Shot], errors_: Collection[Exception]) -> str:
    """Clauses on what shots show in place of the described board, and what to do; "" if that is not clear.

    Args:
        target: the board.
        shown: some of the shots.
        errors_: why images are not used.
    """
    images = _images(shown)
    if said := _instead(target, images):
        return f"{said}: {_CORRECT}"
    if said := _advice(errors_):
        return said
    said = f"{said}: {_CORRECT}" if (said := _chessboard(target, images)) else ""
    return ". ".join(filter(None, (said, _exposure(shown))))


def more_than_described(target: Target, shown: Sequence[Shot]) -> str:
    """Sentence on a chessboard that has more corners than its description; "" if two images do not agree on it.

    Some of its corners are then taken for the described board, other ones by another sensor or in another image.
    """
    if not isinstance(target, Chessboard):
        return ""
    sizes = Counter(chessboard_size(levels) for _, levels in _images(shown))
    longer, shorter = sorted(target.grid, reverse=True)
    for (columns, rows), count in sizes.most_common():
        if count > 1 and columns >= longer and rows >= shorter and (columns, rows) != (longer, shorter):
            return (
                f"{count} images show a board of {columns} × {rows} inner corners, more than the {target.columns} × "
                f"{target.rows} of the description, so that other corners may be taken in each image: {_CORRECT}"
            )
    return ""


def mostly_moved(seen: BoardObservations) -> bool:
    """True if most rejected images seem to show a board that moves."""
    moved = sum(isinstance(error, errors.MovedError) for error in seen.rejected.values())
    return 2 * moved > len(seen.rejected)


def found(new: BoardObservations) -> str:
    """Sensors that see the board in a shot, and why others do not."""
    parts = [view.sensor for view in new.corners]
    parts += [f"not {sensor} ({_WORDS[type(error)]})" for (_, sensor), error in new.rejected.items()]
    return ", ".join(parts) or "no board"


def unused(sensor: str, seen: BoardObservations) -> str:
    """End of a sentence on the images of a sensor that are used, with the reasons of the others; "" without any."""
    errors_ = [error for (_, name), error in seen.rejected.items() if name == sensor]
    return f"; not used: {reasons(errors_)}" if errors_ else ""


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


def _images(shown: Sequence[Shot]) -> list[tuple[str, Grey]]:
    """Names and levels of the images of some shots."""
    return [
        (f"Image {shot.number}", grey(each.image))
        for shot in shown
        for each in shot.sensor_shots.values()
        if each.image.size
    ]


def _instead(target: Target, images: Sequence[tuple[str, Grey]]) -> str:
    """Clause on markers or discs that images show in place of the described board; "" if that is not clear."""
    for image, levels in images:
        if said := description.mismatch(target, levels):
            return f"{image} {said}"
    if isinstance(target, Circles | AsymmetricCircles):
        clauses = ((image, other_discs(target, levels)) for image, levels in images)
        return next((f"{image} {said}" for image, said in clauses if said), "")
    return ""


def _chessboard(target: Target, images: Sequence[tuple[str, Grey]]) -> str:
    """Clause on a chessboard in place of the described board; "" if it is that, or two images do not agree on it."""
    if isinstance(target, Circles | AsymmetricCircles):
        return ""
    sizes = Counter(chessboard_size(levels) for _, levels in images)
    ((columns, rows), count), *_ = sizes.most_common(1) or [((0, 0), 0)]
    is_same = {columns, rows} == {*target.grid}
    if count < 2 or columns == 0 or (is_same and isinstance(target, Chessboard)):
        return ""
    unread = ", and no markers that can be read" if is_same and isinstance(target, Charuco) else ""
    return f"{count} images show a board of {columns} × {rows} inner corners{unread}"


def _exposure(shown: Sequence[Shot]) -> str:
    """Clause on the first image that is too bright or too dark to show a board well, and what to do; "" without one."""
    for shot in shown:
        for image in (each.image for each in shot.sensor_shots.values() if each.image.size):
            if (bright := is_saturated(image).mean()) > _BRIGHT:
                said = f"{bright:.0%} of image {shot.number} is as bright as the sensor can tell"
                return f"{said}: use a shorter exposure, or less light"
            if image.dtype == np.uint8 and (level := np.percentile(image, 99)) < _DARK:
                said = f"Image {shot.number} is nearly black, 99% of it at most {level:.0f} of 255"
                return f"{said}: use a longer exposure, or more light"
    return ""
