"""Boards with markers that are not as described: another dictionary, layout or pattern."""

import re
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board.april_grid import BORDER, AprilGrid
from calib.board.corners.errors import OtherBoardError
from calib.board.corners.markers import find_markers
from calib.board.corners.to_8bit import Grey
from calib.board.target import DICTIONARIES, Charuco, Target

#: Minimum number of markers that say which dictionary a board has, and how they stand.
MIN_MARKERS, MIN_PLACED = 4, 6

#: Images are searched at this size at most [px]; markers need not be exact.
_MAX_SIDE = 1600

#: Largest number of columns that is tried.
_MAX_COLUMNS = 30

#: Percentile of the markers that have to stand so; a few may be misread.
_PERCENTILE = 80

#: Markers stand as on a board if they are off by less than this share of a square, and three times less than otherwise.
_OFF, _CLEARLY = 0.3, 3.0

#: Tags are off by more than this share of their size if columns, rows or numbers are wrong; gaps, if these are.
_OTHER_LAYOUT, _OTHER_GAP = 0.8, 0.15

#: Share of the neighbours that may be misread. Of a grid that begins with another number, only one column is displaced.
_MISREAD = 0.05

#: Kalibr's tags have a wider frame than markers.
_APRIL_GRID = "apriltag_36h11"

#: Dictionaries with so many markers that a search leaves them out, unless the description is of their kind.
_SLOW = re.compile("_1000|36h10")

#: Said of a board whose upper left square is of the other colour, by whether that is black.
_OTHER_PATTERN = {
    True: "shows a ChArUco whose upper left square is black (without legacy)",
    False: (
        "shows a ChArUco whose upper left square is white, as OpenCV before 4.6 printed it with an even number of "
        "rows (legacy = true)"
    ),
}


@dataclass(frozen=True)
class _Markers:
    """Markers of one dictionary in an image.

    Attributes:
        family: the largest dictionary that has them.
        border: width of their black frame [cells].
        ids: their numbers (n,).
        centers: their centres (n, 2) [px].
    """

    family: str
    border: int
    ids: NDArray[np.intp]
    centers: NDArray[np.float64]

    @property
    def name(self) -> str:
        """The smallest dictionary that has these numbers, as described; larger ones begin with the same markers."""
        bits = self.family.rpartition("_")[0]
        sizes = [int(name.rpartition("_")[2]) for name in DICTIONARIES if re.fullmatch(rf"{bits}_\d+", name)]
        return next((f"{bits}_{size}" for size in sizes if size > self.ids.max()), self.family)


def mismatch(target: Target, levels: Grey) -> str:
    """Clause on what markers in an image say against the description of a board; "" if they say nothing."""
    image = _smaller(levels)
    family, border = (_family(target.dictionary), 1) if isinstance(target, Charuco) else (_APRIL_GRID, BORDER)
    # Some of the markers with a wider frame look like others with a narrow one, and the other way round.
    seen = max((_markers(image, family, each) for each in (border, 3 - border)), key=lambda each: len(each.ids))
    if len(seen.ids) < MIN_MARKERS:
        if len(_markers(255 - image, family, border).ids) >= MIN_MARKERS:
            return "shows markers in white on black instead of black on white"
        seen = max((_markers(image, *each) for each in _others(target)), key=lambda each: len(each.ids))
    if len(seen.ids) < MIN_MARKERS:
        return ""
    return _against(target, seen)


def _against(target: Target, seen: _Markers) -> str:
    if (seen.family, seen.border) == (_APRIL_GRID, BORDER):
        return _misplaced(target, seen) if isinstance(target, AprilGrid) else "shows an AprilGrid"
    if _is_lattice(seen):
        return f"shows single markers of the dictionary {seen.name} without a chessboard, which are not supported"
    if not isinstance(target, Charuco):
        return f"shows a ChArUco with markers of the dictionary {seen.name}"
    if _family(target.dictionary) != seen.family:
        return f"shows markers of the dictionary {seen.name}, the description says {target.dictionary}"
    if seen.border > 1:
        return f"shows markers with a black frame of {seen.border} cells; a ChArUco has 1 here"
    return _misplaced(target, seen)


def require_grid(target: AprilGrid, points: NDArray[np.float64]) -> None:
    """Checks detected points (rows, columns, 2) [px], NaN where there are none, against the layout of a grid.

    Neighbours tell, and of tags without any the homography of all.

    Raises:
        OtherBoardError: tags do not stand where the description has them; says what is wrong.
    """
    off, gaps = [], []
    for along in (points, points.transpose(1, 0, 2)):
        first, last, following = along[:, :-2:2], along[:, 1:-1:2], along[:, 2::2]
        tags, gap = last - first, following - last
        sizes = np.sum(tags**2, axis=-1)
        gaps.append((np.sum(gap * tags, axis=-1) / sizes).ravel())
        off.append(np.sqrt(np.sum((gap - target.gap / target.tag * tags) ** 2, axis=-1) / sizes).ravel())
    known = [each[np.isfinite(each)] for each in off]
    ratios = np.concatenate(gaps)
    is_off = any(len(each) and np.mean(each > _OTHER_LAYOUT) > _MISREAD for each in known)
    if is_off or _layout(target, _tags(points))[0] not in (0, target.columns):
        raise OtherBoardError(
            f"the tags do not stand as on a board of {target.columns} × {target.rows} tags with number 0 in the lower "
            "left corner. Are columns and rows right?"
        )
    ratio, said = float(np.nanmedian(ratios)) if np.isfinite(ratios).any() else np.nan, target.gap / target.tag
    if abs(ratio / said - 1) > _OTHER_GAP:
        raise OtherBoardError(
            f"the gaps between the tags are {ratio:.2f} of a tag wide, but {said:.2f} as described. Measure both"
        )


def _tags(points: NDArray[np.float64]) -> _Markers:
    """Tags of a grid whose corners (rows, columns, 2) [px] were all found."""
    rows, columns = (count // 2 for count in points.shape[:2])
    centers = points.reshape(rows, 2, columns, 2, 2).mean(axis=(1, 3))[::-1].reshape(-1, 2)
    ids = np.flatnonzero(np.isfinite(centers).all(axis=1))
    return _Markers(_APRIL_GRID, BORDER, ids, centers[ids])


def _smaller(levels: Grey) -> Grey:
    scale = _MAX_SIDE / max(levels.shape)
    if scale >= 1:
        return levels
    return np.asarray(cv2.resize(levels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)


def _family(dictionary: str) -> str:
    """The dictionary that is searched for those of its family; of 1000 markers, few boards have more than 250."""
    return re.sub(r"^(\dx\d)_(50|100|250)$", r"\1_250", dictionary)


def _others(target: Target) -> list[tuple[str, int]]:
    """Dictionaries and widths of frames [cells] to search for markers that are not as described."""
    every = [name for name in dict.fromkeys(map(_family, DICTIONARIES)) if not _SLOW.search(name)]
    others = [*((name, 1) for name in every), (_APRIL_GRID, BORDER)]
    if isinstance(target, Charuco):
        others += [(f"{bits[0]}_1000", 1) for bits in re.finditer(r"^\dx\d", target.dictionary)]
    return others


def _is_lattice(seen: _Markers) -> bool:
    """True if markers stand in rows and columns without the squares between them that a ChArUco has."""
    columns = range(2, _MAX_COLUMNS + 1)
    boards = (_places(seen.ids, each, black) for each in columns for black in (True, False))
    if len(seen.ids) < MIN_PLACED or min(_off(each, seen.centers) for each in boards) < _OFF:
        return False
    lattices = (_lattice(seen.ids, each) * (1, up) for each in columns for up in (1, -1))
    return min(_off(each, seen.centers) for each in lattices) < _OFF


def _markers(levels: Grey, family: str, border: int) -> _Markers:
    dictionary = cv2.aruco.getPredefinedDictionary([*DICTIONARIES].index(family))
    numbers, corners = find_markers(levels, dictionary, border)
    return _Markers(family, border, numbers, corners.mean(axis=1))


def _misplaced(target: Charuco | AprilGrid, seen: _Markers) -> str:
    """Other numbers of columns and rows, or squares of the other colour, by where markers stand."""
    count = target.columns * target.rows // (2 if isinstance(target, Charuco) else 1)
    first, hint = (target.first_id, ": is first_id right?") if isinstance(target, Charuco) else (0, "")
    size, least, largest = f"{target.columns} × {target.rows}", int(seen.ids.min()), int(seen.ids.max())
    numbers = f"from {least} to {largest}" if least else f"up to {largest}"
    ids = f"shows markers with ids {numbers}, a board of {size} has {first} to {first + count - 1}{hint}"
    if least < first:
        return ids
    seen, largest = replace(seen, ids=seen.ids - first), largest - first
    columns, is_first_black = _layout(target, seen)
    if columns and is_first_black != _is_first_black(target):
        return _OTHER_PATTERN[is_first_black]
    if columns in (0, target.columns):
        return ids if largest >= count else ""
    is_last_row_seen = largest >= count * (1 - 1 / target.columns)
    if columns == target.rows and is_last_row_seen and largest < count:
        return f"fits with columns and rows exchanged, {columns} × {target.columns} instead of {size}"
    return f"shows markers with ids {numbers} that stand as on a board of {columns} columns, not of {size}"


def _layout(target: Charuco | AprilGrid, seen: _Markers) -> tuple[int, bool]:
    """Number of columns, and whether the upper left square is black; 0 columns if the markers do not tell."""
    own = target.columns, _is_first_black(target)
    if len(seen.ids) < MIN_PLACED:
        return 0, True
    colors = (True, False) if isinstance(target, Charuco) else (True,)
    tried = {
        (columns, black): _off(
            _lattice(seen.ids, columns) if isinstance(target, AprilGrid) else _places(seen.ids, columns, black),
            seen.centers,
        )
        for columns in range(2, _MAX_COLUMNS + 1)
        for black in colors
    }
    given = tried.get(own, np.inf)
    best = min(tried, key=lambda key: tried[key])
    if given < _OFF or tried[best] > _OFF or given < _CLEARLY * tried[best]:
        return own if given < _OFF else (0, True)
    return best


def _is_first_black(target: Charuco | AprilGrid) -> bool:
    return target.is_first_black if isinstance(target, Charuco) else True


def _lattice(ids: NDArray[np.intp], columns: int) -> NDArray[np.float64]:
    """Places of tags on an AprilGrid of a number of columns (n, 2) [tags]."""
    return np.stack([ids % columns, -(ids // columns)], axis=1).astype(np.float64)


def _places(ids: NDArray[np.intp], columns: int, black: bool) -> NDArray[np.float64]:
    """Places of markers on a ChArUco of a number of columns (n, 2) [squares]."""
    row, column = np.divmod(np.arange(2 * (int(ids.max()) + columns + 1)), columns)
    white = (row + column) % 2 == int(black)
    return np.stack([column[white][ids], row[white][ids]], axis=1).astype(np.float64)


def _off(places: NDArray[np.float64], centers: NDArray[np.float64]) -> float:
    """Distance by which most markers are off places on a board that is seen from its printed side [squares]."""
    if min(np.linalg.matrix_rank(each - each.mean(axis=0)) for each in (places, centers)) < 2:
        return np.inf
    H, _ = cv2.findHomography(centers, places)
    if H is None or np.linalg.det(H) * H[2, 2] <= 0:
        return np.inf
    off = np.linalg.norm(cv2.perspectiveTransform(centers[:, None], H)[:, 0] - places, axis=1)
    return float(np.percentile(off, _PERCENTILE))
