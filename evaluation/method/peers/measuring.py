"""Runs a tracker through a scene: its errors and what it costs."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from abs_service.tracking.log.truth import closest_points
from evaluation.method.peers.competitors import SheetTracker
from evaluation.scenes.bent_sheet import SIDE, SheetFrame, State, places

#: A tracker whose vertices are on average farther than this from their material, in so many frames in a row, has lost
#: the object [m]; five frames are a sixth of a second.
LOST_M, LOST_FRAMES = 0.01, 5


@dataclass(frozen=True, eq=False)
class TrackedRun:
    """Result of one tracker on one sequence, without the first frame, whose state is given.

    Attributes:
        at: places (n, 2) [m] of the vertices on the flat sheet.
        states: the sheet in every frame.
        vertices: of every frame (n, 3) [m].
        cpu_ms: processor time of every frame, all threads [ms].
    """

    at: NDArray[np.float64]
    states: Sequence[State]
    vertices: Sequence[NDArray[np.floating]]
    cpu_ms: NDArray[np.float64]

    @cached_property
    def vertex_mm(self) -> NDArray[np.float64]:
        """Mean distance of the vertices from their own material [mm], of every frame."""
        return _mean_mm(self.vertices, (state.points(self.at) for state in self.states))

    @cached_property
    def surface_mm(self) -> NDArray[np.float64]:
        """Mean distance of the vertices from the surface [mm], of every frame."""
        pairs, fine = zip(self.vertices, self.states), places(61, 41)
        return _mean_mm(self.vertices, (closest_points(vertices, state.points(fine)) for vertices, state in pairs))

    @property
    def far(self) -> int:
        """Frames until the last one that is far off, from the first such one on."""
        away = np.flatnonzero(self.vertex_mm > LOST_M * 1e3)
        return int(away[-1] - away[0] + 1) if len(away) else 0

    @property
    def lost(self) -> bool:
        """True if the object was lost."""
        return self.far > LOST_FRAMES


def _mean_mm(found: Iterable[NDArray[np.floating]], true: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.array([1e3 * np.linalg.norm(one - other, axis=1).mean() for one, other in zip(found, true)])


def track_frames(tracker: SheetTracker, at: NDArray[np.float64], frames: Sequence[SheetFrame]) -> TrackedRun:
    """Tracks the frames after the first, one right after the other.

    Args:
        tracker: has the first frame behind it.
        at: places (n, 2) [m] of its vertices on the flat sheet.
        frames: the sequence.
    """
    tracked, cpu = [], []
    for frame in frames[1:]:
        begun = time.process_time()
        tracked.append(tracker.track(frame))
        cpu.append(time.process_time() - begun)
    # Errors are found when they are asked for: in between, that would drive what the tracker needs out of the caches.
    return TrackedRun(at, [frame.state for frame in frames[1:]], tracked, 1e3 * np.array(cpu))


#: Makes a tracker that knows the sheet in the first frame, and tells the places (n, 2) [m] of its vertices.
TrackerFactory = Callable[[SheetFrame, float, int], tuple[SheetTracker, NDArray[np.float64]]]


def with_template(make: Callable[[NDArray[np.float64]], SheetTracker]) -> TrackerFactory:
    """A maker for what begins with the template's vertices."""

    def start(first: SheetFrame, sigma: float, seed: int) -> tuple[SheetTracker, NDArray[np.float64]]:
        at = places(SIDE, SIDE).reshape(-1, 2)
        return make(first.state.points(at)), at

    return start
