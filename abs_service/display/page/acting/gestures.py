"""Gestures in the scene that choose something: a click, a box, a lasso. One is waited for at a time."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import viser
from numpy.typing import NDArray
from viser import transforms

#: Largest distance of the click that closes a lasso from its first corner, in heights of the scene.
CLOSE = 0.03

#: Colour of a lasso while it is drawn, and its distance from the eye [m].
LASSO, LASSO_M = (255, 200, 40), 0.2

#: Width of its lines [px].
LINE_PX = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Eye:
    """The camera of a browser's view; the scene is 1 high, `aspect` wide, and begins at its upper left corner.

    Attributes:
        T_re: pose (4, 4) of the eye in rig coordinates: x right, y down, z forward.
        fov: vertical field of view [rad].
        aspect: width of the scene by its height.
    """

    T_re: NDArray[np.float64]
    fov: float
    aspect: float

    def project(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Places (n, 2) of points (n, 3) [m] in the scene; NaN behind the eye."""
        points_e = (points - self.T_re[:3, 3]) @ self.T_re[:3, :3]
        ahead = np.where(points_e[:, 2:] > 0, points_e[:, 2:], np.nan)
        return points_e[:, :2] / ahead / (2 * np.tan(self.fov / 2)) + (self.aspect / 2, 0.5)

    def sees_like(self, other: "Eye") -> bool:
        """True if neither pose nor size differs between the two."""
        return np.allclose(self.T_re, other.T_re, atol=1e-4) and self.aspect == other.aspect


#: Origin [m] and direction (3,) of the ray under a click, in rig coordinates.
Ray = tuple[NDArray[np.float64], NDArray[np.float64]]


class Gestures:
    """Waits for one gesture of any browser; another request replaces it."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._lasso: list[NDArray[np.float64]] = []
        self._seen_from: Eye | None = None

    def click(self, call: Callable[[Ray], None]) -> None:
        """Calls once, from another thread, with the ray under the next click."""
        self._forget()

        def clicked(event: viser.SceneClickEvent) -> None:
            self._forget()
            call((np.array(event.ray_origin), np.array(event.ray_direction)))

        self._scene.on_click()(clicked)

    def box(self, call: Callable[[Eye, NDArray[np.float64]], None]) -> None:
        """Calls once, from another thread, with the eye and the corners (4, 2) of the next box that is drawn."""
        self._forget()

        def drawn(event: viser.SceneRectSelectEvent) -> None:
            self._forget()
            eye = _eye(event.client)
            (left, top), (right, bottom) = event.screen_min, event.screen_max
            corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
            call(eye, corners * (eye.aspect, 1.0))

        self._scene.on_rect_select()(drawn)

    def lasso(self, call: Callable[[Eye, NDArray[np.float64]], None], restarted: Callable[[], None]) -> None:
        """Calls once, from another thread, with the eye and the corners (k, 2) that were clicked, three or more.

        A click near the first corner closes the lasso.

        Args:
            call: takes the lasso.
            restarted: called when the view has moved, so that the lasso begins with this click.
        """
        self._forget()

        def clicked(event: viser.SceneClickEvent) -> None:
            eye = _eye(event.client)
            place = np.array(event.screen_pos) * (eye.aspect, 1.0)
            if self._lasso and self._seen_from is not None and not eye.sees_like(self._seen_from):
                self._lasso.clear()
                restarted()
            if len(self._lasso) >= 3 and np.linalg.norm(place - self._lasso[0]) <= CLOSE:
                corners = np.array(self._lasso)
                self._forget()
                call(eye, corners)
                return
            self._lasso.append(place)
            self._seen_from = eye
            self._draw(eye)

        self._scene.on_click()(clicked)

    def _draw(self, eye: Eye) -> None:
        """Draws the lasso so far, a little before the eye, where nothing hides it; its first corner is a cross."""
        places = np.array(self._lasso) - (eye.aspect / 2, 0.5)
        first = places[0]
        cross = [[first - step, first + step] for step in CLOSE / 2 * np.eye(2)]
        lines = np.array([*cross, *pairwise(places)])
        flat = np.concatenate([lines * 2 * np.tan(eye.fov / 2), np.ones((*lines.shape[:2], 1))], axis=2)
        points = (LASSO_M * flat) @ eye.T_re[:3, :3].T + eye.T_re[:3, 3]
        self._scene.add_line_segments(
            "/lasso", points.astype(np.float32), LASSO, thickness=LINE_PX, thickness_units="screen"
        )

    def _forget(self) -> None:
        self._scene.remove_click_callback()
        self._scene.remove_rect_select_callback()
        if self._lasso:
            self._lasso.clear()
            self._scene.remove_by_name("/lasso")


def _eye(client: viser.ClientHandle) -> Eye:
    camera = client.camera
    T_re = np.eye(4)
    T_re[:3, :3] = transforms.SO3(np.asarray(camera.wxyz)).as_matrix()
    T_re[:3, 3] = camera.position
    return Eye(T_re, float(camera.fov), float(camera.aspect))
