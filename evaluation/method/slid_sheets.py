"""Sequences of a sheet that moves along itself: by jumps, slowly, past the end of the view, or in wrinkles."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evaluation.scenes.bent_sheet import CAMERA, INTERVAL_S, SheetFrame, SheetScene, SheetState, swing
from evaluation.scenes.curtain import Curtain
from evaluation.scenes.surfaces import Wall

#: Frame of the slide, and number of frames after it.
SLIDE_FRAME, FRAMES_AFTER = 30, 30

#: The wall behind the table's sheet [m], and how far it is drawn in a frame [m].
TABLE, CREEP_M = Wall(1.002), 2e-3

#: Share of the returns that single pixels lose, and how far a sheet slides meanwhile [m].
DROPOUTS, DROPOUT_SLIDE_M = 0.3, 0.04

#: Last columns in which the sensor never measures (8 of 640 in a Kinect v1), and where a sheet is that they cut [m].
BLIND_COLUMNS, CUT_AT_M = 3, (0.4, 0.0)

#: Widths and heights of the corners in which an Azure Kinect's narrow mode never measures, at the top and at the
#: bottom, as shares of the image's, and where a sheet is that one of them cuts [m].
BLIND_CORNERS, CORNER_AT_M = ((0.24, 0.48), (0.23, 0.43)), (0.36, -0.2)

#: How far a sheet that is cut is drawn in a frame [m].
CUT_STEP_M = 5e-3

#: First columns of the stripes without return that interrupt a sheet, their width [px], and how far it is drawn under
#: them in a frame [m].
STRIPES, STRIPE_PX, STRIPED_STEP_M = (72, 99), 5, 1e-3

#: Where a plate is, its radius [m], and by how much it turns in a frame [rad].
PLATE_AT_M, PLATE_RADIUS_M, PLATE_STEP = 0.6, 0.09, np.deg2rad(2)

#: Phases of the wrinkles of three curtains in the first frame [rad], and the noise of their distances [m].
CURTAINS, CURTAIN_SIGMA = (0.0, 2.0, 4.0), 2e-3

#: Distances beyond are no returns in the scene without a background [m].
MAX_DISTANCE_M = 1.3

#: A sequence: its name, its scene, and what the sensor measures of a frame.
SlidSheet = tuple[str, SheetScene, Callable[[SheetFrame], SheetFrame]]


@dataclass(frozen=True)
class Slide:
    """A swinging sheet that lies farther along itself from one frame on."""

    by_m: float

    def __call__(self, t: float) -> SheetState:
        """The sheet at a time [s]."""
        state = swing(t)
        return _drawn(state, self.by_m) if t > (SLIDE_FRAME - 0.5) * INTERVAL_S else state


def creep(t: float) -> SheetState:
    """A flat sheet that is drawn along itself."""
    return _drawn(SheetState(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), CREEP_M * t / INTERVAL_S)


def _drawn(state: SheetState, by_m: float) -> SheetState:
    """The sheet drawn along its long axis, where that is in its centre [m]."""
    ends = state.points(np.array([[-1e-3, 0.0], [1e-3, 0.0]]))
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    x, y, z = np.asarray(state.center) + by_m * along
    return replace(state, center=(float(x), float(y), float(z)))


@dataclass(frozen=True)
class Cut:
    """A flat sheet that is drawn along its long axis.

    Attributes:
        at_m: right and down from the middle at the beginning [m].
        step_m: how far it is drawn in a frame [m].
    """

    at_m: tuple[float, float]
    step_m: float

    def __call__(self, t: float) -> SheetState:
        """The sheet at a time [s]."""
        right, down = self.at_m
        return SheetState(0.0, (0.0, 0.0, 0.0), (right + self.step_m * t / INTERVAL_S, down, 1.0))


def turn_plate(t: float) -> SheetState:
    """A flat sheet that turns in its plane about its centre, on the line of sight."""
    return SheetState(0.0, (0.0, 0.0, float(PLATE_STEP * t / INTERVAL_S)), (0.0, 0.0, PLATE_AT_M))


def sequences(slides_m: Sequence[float]) -> Iterator[SlidSheet]:
    """All sequences, with slides of some lengths [m]."""
    for by in slides_m:
        for behind, measured in (("a wall", _as_it_is), ("no return", _without_background)):
            name = f"slides by {by * 1e3:.0f} mm, {behind} behind"
            yield name, SheetScene(name, Slide(by)), measured
    for behind, measured in (("a wall", _as_it_is), ("no return", _without_background)):
        name = f"slides by {DROPOUT_SLIDE_M * 1e3:.0f} mm, {DROPOUTS:.0%} dropouts, {behind} behind"
        yield name, SheetScene(name, Slide(DROPOUT_SLIDE_M), dropouts=DROPOUTS), measured
    yield "creeps on a table", SheetScene("table", creep, wall=TABLE), _as_it_is
    for view, at_m, measured in (
        ("the view", CUT_AT_M, _without_last_columns),
        ("a hexagonal view", CORNER_AT_M, _without_corners),
    ):
        for way, step_m in (("out of", CUT_STEP_M), ("into", -CUT_STEP_M)):
            name = f"is drawn {way} {view}"
            yield name, SheetScene(name, Cut(at_m, step_m)), measured
    for behind, measured in (("a wall", _as_it_is), ("no return", _without_background)):
        name = f"is drawn under stripes without return, {behind} behind"
        yield name, SheetScene(name, Cut((0.0, 0.0), STRIPED_STEP_M)), lambda frame, of=measured: _striped(of(frame))
    yield "a round plate turns", SheetScene("plate", turn_plate), _plate
    for number, begin in enumerate(CURTAINS):
        yield f"a curtain, {number + 1}", SheetScene("curtain", Curtain(begin), sigma=CURTAIN_SIGMA), _as_it_is


def _as_it_is(frame: SheetFrame) -> SheetFrame:
    return frame


def _without_background(frame: SheetFrame) -> SheetFrame:
    return replace(frame, distance=np.where(frame.distance > MAX_DISTANCE_M, np.float32(np.nan), frame.distance))


def _without_last_columns(frame: SheetFrame) -> SheetFrame:
    distance = frame.distance.copy()
    distance[:, -BLIND_COLUMNS:] = np.nan
    return replace(frame, distance=distance)


def _without_corners(frame: SheetFrame) -> SheetFrame:
    height, width = frame.distance.shape
    right, down = (np.arange(size) / (size - 1) for size in (width, height))
    sideways = np.minimum(right, 1 - right)
    blind = np.zeros((height, width), np.bool_)
    for (share, depth), away in zip(BLIND_CORNERS, (down, 1 - down), strict=True):
        blind |= sideways[None] / share + away[:, None] / depth < 1
    return replace(frame, distance=np.where(blind, np.float32(np.nan), frame.distance))


def _plate(frame: SheetFrame) -> SheetFrame:
    """Frame without what is farther from the line of sight to the sheet's centre than the plate's radius."""
    x, y, z = np.moveaxis(CAMERA.rays(), -1, 0)
    on = frame.sheet & (np.hypot(x, y) / z * PLATE_AT_M < PLATE_RADIUS_M)
    return replace(frame, distance=np.where(on, frame.distance, np.float32(np.nan)), sheet=on)


def _striped(frame: SheetFrame) -> SheetFrame:
    """Frame without the returns of the sheet in the stripes, as in the shadow of a projector."""
    sheet, distance = frame.sheet.copy(), frame.distance.copy()
    for first in STRIPES:
        stripe = (slice(None), slice(first, first + STRIPE_PX))
        distance[stripe][sheet[stripe]] = np.nan
        sheet[stripe] = False
    return replace(frame, distance=distance, sheet=sheet)
