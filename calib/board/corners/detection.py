"""From an image of a board to its corners, or to the reason why this image is of no use."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.board.corners import ellipse, quality, refusal, saddle
from calib.board.corners.order import ordered
from calib.board.corners.search import find, is_cut_off
from calib.board.corners.to_8bit import Grey, Image, grey
from calib.board.target import AsymmetricCircles, Charuco, Circles, Target
from calib.views import CornerView

#: Points without which a view says too little.
LEAST_POINTS = 6
#: Neighbours that are closer together than this are not told apart well enough [px].
LEAST_SPACING_PX = 5.0
#: Largest part of a board that may be saturated. Corners stay where they are when white is, but not when black is …
LARGEST_SATURATED = 0.85
#: … while the distances of a depth sensor are wrong wherever its own light saturates it.
LARGEST_SATURATED_ACTIVE = 0.10
#: Where no board is found, an image that is saturated to this part says why.
_LARGEST_SATURATED_ELSEWHERE = 0.3
#: Edges may rise over this many pixels, or over this part of the distance between points, whichever is longer.
LARGEST_EDGE_PX, LARGEST_EDGE_SHARE = 3.5, 0.15
#: Radius in which a corner is refined, as part of the distance between corners: less than to a ChArUco's markers.
_REFINED = 0.13
#: Points that are closer than this to the end of the image were measured with half of their surroundings [px].
LEAST_BORDER_PX = 2.0

_CUT_OFF = (
    "the board touches the border of the image: all of it must be seen, with a rim around it. Move it to the middle, "
    "or go further away"
)


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """Where an image shows the points of a board.

    Attributes:
        ids: which of `target.points()` (n,).
        pixels: where (n, 2) [px]; centres of pixels are integers.
        sigma_px: standard deviation of one coordinate, estimated from this image [px].
        edge_px: over which edges rise from 10 to 90 % [px]; NaN without two neighbouring points.
        spacing_px: of neighbouring points [px]; NaN without.
    """

    ids: NDArray[np.intp]
    pixels: NDArray[np.float64]
    sigma_px: float
    edge_px: float
    spacing_px: float

    def view(self, target: Target, sensor: str, shot: int, t_s: float) -> CornerView:
        """The same as what a calibration starts from; see `CornerView`."""
        return CornerView(sensor, shot, t_s, target.points()[self.ids], self.pixels, self.sigma_px)


def detect(target: Target, image: Image, largest_saturated: float = LARGEST_SATURATED) -> Detection:
    """Finds a board in an image (height, width) or (height, width, 3) of any type.

    Args:
        target: the board.
        image: as the sensor delivers it.
        largest_saturated: part of the board that may be saturated, 0 to 1.

    Raises:
        BoardError: the image must not be used; the subclass is the reason, see `calib.board.corners.refusal`.
    """
    levels = grey(image)
    ids, pixels = find(target, levels)
    if len(ids) < LEAST_POINTS:
        raise _why_nothing(target, image, levels, len(ids))
    pixels = ordered(target, pixels, levels)
    points = quality.lattice(target, ids, pixels)
    spacing, edge = quality.spacing_px(points), quality.edge_px(target, points, levels)
    _check_whole(target, pixels, points, levels.shape)
    if spacing < LEAST_SPACING_PX:
        raise refusal.TooSmallError(
            f"the board is too small: its points are {spacing:.1f} pixels apart, at least {LEAST_SPACING_PX:g} are "
            "needed. Come closer, or use a board with larger squares"
        )
    _check_saturation(quality.saturated_share(target, ids, pixels, image), largest_saturated)
    if edge > max(LARGEST_EDGE_PX, LARGEST_EDGE_SHARE * spacing):
        raise refusal.BlurredError(
            f"the image is blurred: edges of the board rise over {edge:.1f} pixels. Hold the board still, shorten the "
            "exposure, or focus"
        )
    if isinstance(target, Circles | AsymmetricCircles):
        pixels = pixels - ellipse.bias(target, ids, pixels)
    else:
        pixels = saddle.refine(levels, pixels, int(np.clip(round(_REFINED * spacing), 2, 10)))
    return Detection(ids, pixels, quality.sigma_px(target, ids, pixels), edge, spacing)


def _check_whole(
    target: Target, pixels: NDArray[np.float64], points: NDArray[np.float64], shape: tuple[int, ...]
) -> None:
    """Refuses a board that the image ends on; of a ChArUco, which may be seen in part, only points at the very end."""
    size = np.array([shape[1], shape[0]])
    distance = np.minimum(pixels, size - 1 - pixels).min()
    reach = LEAST_BORDER_PX
    if isinstance(target, Circles | AsymmetricCircles):
        reach += 0.5 * target.diameter / target.spacing * quality.spacing_px(points)
    if distance < reach:
        raise refusal.CutOffError(_CUT_OFF)


def _check_saturation(share: float, largest: float) -> None:
    if share > largest:
        raise refusal.SaturatedError(
            f"{share:.0%} of the board is as bright as the sensor can tell, so edges appear in the wrong place. Use a "
            "shorter exposure, less light, or stand further away"
        )


def _why_nothing(target: Target, image: Image, levels: Grey, found: int) -> refusal.BoardError:
    """The most telling reason why too few points were found."""
    if isinstance(target, Charuco) and len(find(target, np.ascontiguousarray(levels[:, ::-1]))[0]) > found:
        return refusal.MirroredBoardError(
            "the board is seen as in a mirror: switch off the mirroring of the camera or its driver, or print the "
            "board anew if the print itself is mirrored"
        )
    share = float(quality.is_saturated(image).mean())
    if share > _LARGEST_SATURATED_ELSEWHERE:
        return refusal.SaturatedError(
            f"no board found, and {share:.0%} of the image is as bright as the sensor can tell. Use a shorter "
            "exposure, less light, or stand further away"
        )
    if is_cut_off(target, levels):
        return refusal.CutOffError(_CUT_OFF)
    seen = f"only {found} of its points" if found else "none of its points"
    return refusal.NothingFoundError(
        f"no board found: {seen} can be seen. Is it this board, in the image, evenly lit, in focus and not hidden?"
    )
