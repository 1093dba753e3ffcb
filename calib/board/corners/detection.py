"""Detection of a board's corners in an image, with a specific error for every unusable image."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.board.april_grid import AprilGrid
from calib.board.corners import description, ellipse, errors, other_discs, quality, saddle
from calib.board.corners.markers import cell_px, require_one_board
from calib.board.corners.misplaced import is_in_place
from calib.board.corners.order import canonical_order
from calib.board.corners.search import MIN_POINTS, Found, find, is_cut_off
from calib.board.corners.to_8bit import Grey, Image, grey, tones
from calib.board.target import AsymmetricCircles, Charuco, Chessboard, Circles, Target
from calib.board.views import CornerView

#: Minimum distance of neighbouring points [px].
MIN_SPACING_PX = 5.0
#: Width of a marker's cells below which it is hardly read [px].
MIN_CELL_PX = 2.0
#: Largest saturated fraction of a board. Saturated white leaves corners in place, saturated black does not …
MAX_SATURATED = 0.85
#: … while distances of an active depth sensor are wrong wherever it is saturated.
MAX_SATURATED_ACTIVE = 0.10
#: Saturated fraction of the whole image that may be why no board is found, and beyond which none can be.
_MAY_BE_SATURATED, _IS_SATURATED = 0.3, 0.95
#: Largest width of an edge, in pixels or relative to the distance between points, whichever is larger.
MAX_EDGE_PX, MAX_EDGE_SHARE = 3.5, 0.15
#: The latter of a board without markers that is out of focus: edges of both directions are wide, by at most this factor
#: between them. Its points stay in place (0.08 px), while a camera that reads row by row shears a board that moves.
MAX_UNFOCUSED_SHARE, UNFOCUSED = 0.3, 2.0
#: Radius of the subpixel refinement, relative to the distance between corners; excludes a ChArUco's markers.
_REFINED = 0.13
#: Minimum distance of points from the image's border [px]; their neighbourhood must be complete.
MIN_BORDER_PX = 2.0

#: Largest part of the points of a board without markers that may be elsewhere than those beside them say.
MAX_MISPLACED = 0.1
#: Largest part of an outer row or column of a chessboard without corners.
MAX_LOST = 0.5

_CUT_OFF = (
    "the board touches the border of the image: all of it must be seen, with a rim around it. Move it to the middle, "
    "or go further away"
)


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """Detected points of a board.

    Attributes:
        ids: indices into `target.points()` (n,).
        pixels: positions (n, 2) [px]; centres of pixels are integers.
        sigma_px: standard deviation of one coordinate, estimated from this image [px].
        edge_px: width of edges from 10 to 90 % [px]; NaN without two neighbouring points.
        spacing_px: distance of neighbouring points [px]; NaN without any.
    """

    ids: NDArray[np.intp]
    pixels: NDArray[np.float64]
    sigma_px: float
    edge_px: float
    spacing_px: float

    def view(self, target: Target, sensor: str, shot: int, t_s: float) -> CornerView:
        """Conversion to a `CornerView`, the input of a calibration."""
        return CornerView(sensor, shot, t_s, target.points()[self.ids], self.pixels, self.sigma_px)


def detect(target: Target, image: Image, maximum_saturated: float = MAX_SATURATED) -> Detection:
    """Detects a board in an image (height, width) or (height, width, 3) of any type.

    Args:
        target: the board.
        image: as delivered by the sensor.
        maximum_saturated: largest saturated fraction of the board, 0 to 1.

    Raises:
        BoardError: unusable image; the subclass is the reason, see `calib.board.corners.errors`.
    """
    levels, (ids, pixels) = _found(target, image)
    if isinstance(target, AprilGrid) or (isinstance(target, Charuco) and len(ids) < MIN_POINTS):
        require_one_board(target, levels)
    if len(ids) < MIN_POINTS:
        raise _detection_error(target, image, levels, len(ids))
    pixels = canonical_order(target, pixels, levels)
    points = quality.lattice(target, ids, pixels)
    if isinstance(target, AprilGrid):
        description.require_grid(target, points)
    if isinstance(target, Circles | AsymmetricCircles):
        other_discs.require_end(points, levels)
    spacing, (edge, narrow) = quality.spacing_px(points), quality.edges_px(target, points, levels)
    _check_whole(target, pixels, points, levels.shape)
    if spacing < MIN_SPACING_PX:
        raise errors.TooSmallError(
            f"the board is too small: its points are {spacing:.1f} pixels apart, at least {MIN_SPACING_PX:g} are "
            "needed. Come closer, or use a board with larger squares"
        )
    _check_saturation(quality.saturated_fraction(target, ids, pixels, image), maximum_saturated)
    _check_sharp(edge, narrow, spacing, has_markers=isinstance(target, Charuco | AprilGrid))
    if isinstance(target, Circles | AsymmetricCircles):
        pixels = ellipse.centers(target, ids, pixels, levels)
        pixels = pixels - ellipse.center_bias(target, ids, pixels)
    else:
        pixels, is_corner = saddle.refine(levels, pixels, int(np.clip(round(_REFINED * spacing), 2, 10)))
        ids, pixels = ids[is_corner], pixels[is_corner]
    if len(ids) >= MIN_POINTS:
        is_good = is_in_place(target, ids, pixels, spacing)
        _check_order(1 - is_good.mean(), has_markers=isinstance(target, Charuco | AprilGrid))
        ids, pixels = ids[is_good], pixels[is_good]
    if len(ids) < MIN_POINTS:
        raise _detection_error(target, image, levels, len(ids))
    if isinstance(target, Chessboard):
        _check_rim(quality.lattice(target, ids, pixels))
    return Detection(ids, pixels, quality.sigma_px(target, ids, pixels), edge, spacing)


def _found(target: Target, image: Image) -> tuple[Grey, Found]:
    """Points by the tones that show most of them, and these; markers need other tones than distant boards."""
    all_tones = tones(image) if isinstance(target, Charuco | AprilGrid) else [grey(image)]
    every = [(levels, find(target, levels)) for levels in all_tones]
    return max(every, key=lambda each: len(each[1][0]))


def _check_whole(
    target: Target, pixels: NDArray[np.float64], points: NDArray[np.float64], shape: tuple[int, ...]
) -> None:
    """Rejects a board cut off by the border, unless it may be seen in part."""
    if isinstance(target, Charuco | AprilGrid):
        return
    size = np.array([shape[1], shape[0]])
    distance = np.minimum(pixels, size - 1 - pixels).min()
    reach = MIN_BORDER_PX
    if isinstance(target, Circles | AsymmetricCircles):
        reach += 0.5 * target.diameter / target.spacing * quality.spacing_px(points)
    if distance < reach:
        raise errors.CutOffError(_CUT_OFF)


def _check_order(misplaced: float, has_markers: bool) -> None:
    """Rejects points without numbers of which more than single ones are not where they should be, 0 to 1."""
    if misplaced > MAX_MISPLACED and not has_markers:
        raise errors.HiddenError(
            f"{misplaced:.0%} of the points that were found do not stand as on the board, as if some were hidden and "
            "others taken for them: show all of the board, without hands, stains and highlights on it"
        )


def _check_rim(points: NDArray[np.float64]) -> None:
    """Rejects corners of a chessboard (rows, columns, 2), NaN where hidden, that may all be displaced by a square.

    If an outer row or column is hidden, a search may take the ends of the squares on the other side for corners.
    """
    is_lost = np.isnan(points[..., 0])
    if max(side.mean() for side in (is_lost[0], is_lost[-1], is_lost[:, 0], is_lost[:, -1])) > MAX_LOST:
        raise errors.HiddenError(
            "most corners of an outer row or column of the board are hidden, so that the others cannot be numbered: "
            "take the hand off the squares, or describe the board as it is"
        )


def _check_sharp(edge: float, narrow: float, spacing: float, has_markers: bool) -> None:
    """Rejects edges [px] that are too wide; next to a blurred corner, markers move it."""
    is_unfocused = edge < UNFOCUSED * narrow and not has_markers
    if edge > max(MAX_EDGE_PX, (MAX_UNFOCUSED_SHARE if is_unfocused else MAX_EDGE_SHARE) * spacing):
        raise errors.BlurredError(
            f"the image is blurred: edges of the board rise over {edge:.1f} pixels. Hold the board still, shorten the "
            "exposure, or focus"
        )


def _check_saturation(share: float, maximum: float) -> None:
    if share > maximum:
        raise errors.SaturatedError(
            f"{share:.0%} of the board is as bright as the sensor can tell, so edges appear in the wrong place. Use a "
            "shorter exposure, less light, or stand further away"
        )


def _detection_error(target: Target, image: Image, levels: Grey, found: int) -> errors.BoardError:
    """Most specific error for too few points."""
    mirrored = np.ascontiguousarray(levels[:, ::-1])
    if isinstance(target, Charuco | AprilGrid) and len(find(target, mirrored)[0]) >= MIN_POINTS:
        return errors.MirroredBoardError(
            "the board is seen as in a mirror: switch off the mirroring of the camera or its driver, or print the "
            "board anew if the print itself is mirrored"
        )
    share = float(quality.is_saturated(image).mean())
    bright = f"{share:.0%} of the image is as bright as the sensor can tell"
    if share > _IS_SATURATED:
        return errors.SaturatedError(
            f"no board found, and {bright}. Use a shorter exposure, less light, or stand further away"
        )
    if is_cut_off(target, levels):
        return errors.CutOffError(_CUT_OFF)
    if isinstance(target, Charuco | AprilGrid) and (cell := cell_px(target, levels)) < MIN_CELL_PX:
        return errors.TooSmallError(
            f"the board is too small: the cells of its markers are {cell:.1f} pixels wide, at least {MIN_CELL_PX:g} "
            "are needed. Come closer, or use a board with larger squares"
        )
    seen = f"only {found} of its points" if found else "none of its points"
    hint = f" {bright}, which may be why." if share > _MAY_BE_SATURATED else ""
    return errors.NothingFoundError(
        f"no board found: {seen} can be seen. Is it this board, in the image, evenly lit, in focus and not "
        f"hidden?{hint}"
    )
