"""Runs a follower through a scene: its errors and what it costs."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from abs_service.evaluation import closest_points
from abs_service.experiments.peers.rivals import Follower
from abs_service.experiments.peers.scene import SIDE, Shot, places

#: A follower whose vertices are on average farther than this from their material, in so many frames in a row, has lost
#: the object [m]; five frames are a sixth of a second.
LOST_M, LOST_FRAMES = 0.01, 5


@dataclass(frozen=True, eq=False)
class Followed:
    """What one tracker made of one sequence, the first frame, of which everything is known, left out.

    Attributes:
        at: places (n, 2) [m] of the vertices on the flat sheet.
        vertices: of every frame (n, 3) [m].
        vertex_mm, surface_mm: mean distance of the vertices from their own material, and from the surface [mm].
        cpu_ms: processor time of every frame, all threads [ms].
    """

    at: NDArray[np.float64]
    vertices: Sequence[NDArray[np.floating]]
    vertex_mm: NDArray[np.float64]
    surface_mm: NDArray[np.float64]
    cpu_ms: NDArray[np.float64]

    @property
    def far(self) -> int:
        """Frames until the last one that is far off, from the first such one on."""
        away = np.flatnonzero(self.vertex_mm > LOST_M * 1e3)
        return int(away[-1] - away[0] + 1) if len(away) else 0

    @property
    def lost(self) -> bool:
        """Whether the object was lost."""
        return self.far > LOST_FRAMES


def follow(follower: Follower, at: NDArray[np.float64], shots: Sequence[Shot]) -> Followed:
    """Follows shots after the first, one right after the other.

    Args:
        follower: has the first shot behind it.
        at: places (n, 2) [m] of its vertices on the flat sheet.
        shots: the sequence.
    """
    tracked, cpu = [], []
    for shot in shots[1:]:
        begun = time.process_time()
        tracked.append(follower.track(shot))
        cpu.append(time.process_time() - begun)
    # Errors are found afterwards: in between, that would drive what the tracker needs out of the caches.
    fine, vertex, surface = places(61, 41), [], []
    for shot, vertices in zip(shots[1:], tracked):
        vertex.append(np.linalg.norm(vertices - shot.moment.points(at), axis=1).mean())
        closest = closest_points(vertices, shot.moment.points(fine))
        surface.append(np.linalg.norm(vertices - closest, axis=1).mean())
    return Followed(at, tracked, 1e3 * np.array(vertex), 1e3 * np.array(surface), 1e3 * np.array(cpu))


def least(repeats: Sequence[Followed]) -> Followed:
    """A sequence that was followed several times, with the least time of each frame: what else runs only adds to it."""
    return replace(repeats[0], cpu_ms=np.min([one.cpu_ms for one in repeats], axis=0))


#: Makes a follower that knows the sheet in the first shot, and tells the places (n, 2) [m] of its vertices.
Make = Callable[[Shot, float, int], tuple[Follower, NDArray[np.float64]]]


def with_template(make: Callable[[NDArray[np.float64]], Follower]) -> Make:
    """A maker for what begins with the template's vertices."""

    def start(first: Shot, sigma: float, seed: int) -> tuple[Follower, NDArray[np.float64]]:
        at = places(SIDE, SIDE).reshape(-1, 2)
        return make(first.moment.points(at)), at

    return start
