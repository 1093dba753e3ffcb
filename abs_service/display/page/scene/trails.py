"""Vertices that a user picks: where each was in the last seconds, and its σ over the last minute."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service.display.page.acting.gestures import Ray
from abs_service.display.page.numbers import MINUTE_S
from abs_service.display.page.pictures import under_ray
from abs_service.display.page.scene.fields import MeshView, ShownMesh, joined, sigma

#: Length of a trail [ns].
TRAIL_NS = 10_000_000_000

#: Places that are farther apart in time are not joined: the path between them is unknown [ns].
GAP_NS = 500_000_000


@dataclass(slots=True)
class _Followed:
    """A vertex: its places [m] by exposure [ns], and its σ [mm] by arrival [s]."""

    places: list[tuple[int, NDArray[np.float64]]] = field(default_factory=list)
    sigmas: list[tuple[float, float]] = field(default_factory=list)


class Trails:
    """Trails of vertices; safe from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._meshes: dict[str, object] = {}  # by tracker
        self._followed: dict[tuple[str, int], _Followed] = {}  # by tracker and vertex

    def follow(self, meshes: Mapping[str, MeshView], ray: Ray) -> bool:
        """Begins a trail of the vertex that a ray meets; False if it meets no mesh.

        Args:
            meshes: by tracker.
            ray: in rig coordinates.
        """
        vertices, faces, _ = joined(meshes.values())
        if not len(faces):
            return False
        edge_m = float(np.median(np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1)))
        vertex = under_ray(vertices, *ray, edge_m)
        if vertex is None:
            return False
        for tracker, view in meshes.items():
            if vertex < len(view.vertices):
                with self._lock:
                    self._followed.setdefault((tracker, vertex), _Followed())
                break
            vertex -= len(view.vertices)
        return True

    def extend(self, tracker: str, mesh: object, drawn: ShownMesh, now_s: float) -> None:
        """Adds where the vertices are, and their σ.

        Args:
            tracker: its name.
            mesh: identity of its mesh; the vertices of another one are others, so that trails end.
            drawn: the mesh. An earlier exposure, after a jump in a recording, begins the trails anew.
            now_s: time of its arrival [s].
        """
        exposure_ns, deviations_mm = drawn.exposure_ns, sigma(drawn.view)
        with self._lock:
            if self._meshes.setdefault(tracker, mesh) != mesh:
                self._meshes[tracker] = mesh
                self._followed = {key: one for key, one in self._followed.items() if key[0] != tracker}
            for (name, vertex), one in self._followed.items():
                if name != tracker:
                    continue
                if one.places and exposure_ns < one.places[-1][0]:
                    one.places, one.sigmas = [], []
                kept = [place for place in one.places if exposure_ns - TRAIL_NS <= place[0] < exposure_ns]
                one.places = [*kept, (exposure_ns, drawn.view.vertices[vertex])]
                recent = [value for value in one.sigmas if now_s - MINUTE_S <= value[0] <= now_s]
                one.sigmas = [*recent, (now_s, float(deviations_mm[vertex]))]

    def lines(self, tracker: str) -> NDArray[np.float32]:
        """Lines (n, 2, 3) [m] of a tracker's trails."""
        with self._lock:
            trails = [one.places for (name, _), one in self._followed.items() if name == tracker]
            pairs = [
                (before[1], after[1])
                for places in trails
                for before, after in pairwise(places)
                if after[0] - before[0] <= GAP_NS
            ]
        return np.array(pairs, np.float32).reshape(-1, 2, 3)

    def sigmas(self, tracker: str) -> dict[str, NDArray[np.float64]]:
        """Arrival [s] and σ [mm] (n, 2) of a tracker's followed vertices over the last minute, by name."""
        with self._lock:
            return {
                f"vertex {vertex}": np.array(one.sigmas).reshape(-1, 2)
                for (name, vertex), one in self._followed.items()
                if name == tracker
            }

    def forget(self) -> None:
        """Ends all trails."""
        with self._lock:
            self._followed.clear()
