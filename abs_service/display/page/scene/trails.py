"""Trails of vertices that a user picks: where each was in the last seconds."""

import threading
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from abs_service.display.page.acting.gestures import Ray
from abs_service.display.page.pictures import under_ray
from abs_service.display.page.scene.fields import MeshView, joined

#: Length of a trail [ns].
TRAIL_NS = 10_000_000_000

#: Places that are farther apart in time are not joined: the path between them is unknown [ns].
GAP_NS = 500_000_000


class Trails:
    """Trails of vertices; safe from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._meshes: dict[str, object] = {}  # by tracker
        self._places: dict[tuple[str, int], list[tuple[int, NDArray[np.float64]]]] = {}  # by tracker and vertex

    def follow(self, meshes: Mapping[str, MeshView], ray: Ray) -> bool:
        """Begins a trail of the vertex that a ray meets; False if it meets no mesh.

        Args:
            meshes: by tracker.
            ray: in rig coordinates.
        """
        vertices, faces = joined(meshes.values())
        if not len(faces):
            return False
        edge_m = float(np.median(np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1)))
        vertex = under_ray(vertices, *ray, edge_m)
        if vertex is None:
            return False
        for tracker, view in meshes.items():
            if vertex < len(view.vertices):
                with self._lock:
                    self._places.setdefault((tracker, vertex), [])
                break
            vertex -= len(view.vertices)
        return True

    def extend(self, tracker: str, mesh: object, vertices: NDArray[np.float64], exposure_ns: int) -> None:
        """Adds where the vertices are.

        Args:
            tracker: its name.
            mesh: identity of its mesh; the vertices of another one are others, so that trails end.
            vertices: positions (n, 3) [m].
            exposure_ns: time of them [ns]; an earlier one, after a jump in a recording, begins the trails anew.
        """
        with self._lock:
            if self._meshes.setdefault(tracker, mesh) != mesh:
                self._meshes[tracker] = mesh
                self._places = {key: places for key, places in self._places.items() if key[0] != tracker}
            for (name, vertex), places in self._places.items():
                if name != tracker:
                    continue
                if places and exposure_ns < places[-1][0]:
                    places.clear()
                kept = [one for one in places if exposure_ns - TRAIL_NS <= one[0] < exposure_ns]
                places[:] = [*kept, (exposure_ns, vertices[vertex])]

    def lines(self, tracker: str) -> NDArray[np.float32]:
        """Lines (n, 2, 3) [m] of a tracker's trails."""
        with self._lock:
            trails = [places for (name, _), places in self._places.items() if name == tracker]
            pairs = [
                (before[1], after[1])
                for places in trails
                for before, after in pairwise(places)
                if after[0] - before[0] <= GAP_NS
            ]
        return np.array(pairs, np.float32).reshape(-1, 2, 3)

    def forget(self) -> None:
        """Ends all trails."""
        with self._lock:
            self._places.clear()
