"""The object as a user chooses it in the scene: by a click, a box or a lasso, as pixels of a depth image."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from abs_service.display.page import pictures
from abs_service.display.page.acting.gestures import Eye, Gestures, Ray
from abs_service.wire import commands
from abs_service.wire.commands import Choice, Pixel
from calib.camera import Camera
from drivers.encoding.message_content import MAX_CORNERS, MIN_CORNERS

#: Largest distance of a chosen point from the ray of the click, in distances between neighbouring points.
REACH = 1.5

#: Pixels over which the pixels inside a lasso are joined, and the smallest patch of them that counts.
GAP_PX, SPECK_PX = 5, 16

#: Largest distance of a lasso's simplified polygon from its pixels, at first [px].
SIMPLIFIED_PX = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A depth image: radial distances (height, width) [m], NaN without return, and the camera that measured them."""

    distance: NDArray[np.floating]
    camera: Camera


#: The newest depth image of a tracker's reference; None if there is none.
Look = Callable[[str], Measured | None]


class Choosing:
    """Waits for a gesture, then says how to make it, and asks for a detection of what it chooses.

    Messages reach a browser in their order, so that it takes the gesture when it shows the hint.
    """

    def __init__(
        self, gestures: Gestures, look: Look, say: Callable[[str], None], ask: Callable[[str, Choice], None]
    ) -> None:
        self._gestures, self._look, self._say, self._ask = gestures, look, say, ask

    def by_click(self, tracker: str) -> None:
        """Waits for a click at the object."""
        self._gestures.click(lambda ray: self._choose(tracker, lambda measured: at_ray(measured, ray)))
        self._say("Click the object among the measured points.")

    def by_box(self, tracker: str) -> None:
        """Waits for a box around the object."""
        self._gestures.box(lambda eye, drawn: self._choose(tracker, lambda measured: in_box(measured, eye, drawn)))
        self._say("Draw a box around the object: press in one corner, and release in the other.")

    def by_lasso(self, tracker: str) -> None:
        """Waits for clicks around the object."""
        text = "Click around the object, corner by corner, and at last the first corner again."
        self._gestures.lasso(
            lambda eye, drawn: self._choose(tracker, lambda measured: in_lasso(measured, eye, drawn)),
            lambda: self._say(f"The view has moved, so the lasso begins anew. {text}"),
        )
        self._say(text)

    def _choose(self, tracker: str, choose: Callable[[Measured], Choice | None]) -> None:
        measured = self._look(tracker)
        choice = choose(measured) if measured else None
        if choice is None:
            self._say("There is no measured point of the tracker's reference sensor where you pointed.")
        else:
            self._ask(tracker, choice)


def at_ray(measured: Measured, ray: Ray) -> Choice | None:
    """The pixel whose point a ray meets; None if it meets none."""
    points_r, pixels, spacing_m = pictures.cloud(measured.distance, measured.camera)
    found = pictures.under_ray(points_r, *ray, REACH * spacing_m)
    if found is None:
        return None
    row, column = pixels[found].tolist()
    return Choice(seed=(column, row))


def in_box(measured: Measured, eye: Eye, drawn: NDArray[np.float64]) -> Choice | None:
    """The box of pixels whose points lie in a box on the screen, with corners (4, 2); None if there are too few."""
    rows, columns = np.nonzero(_inside(measured, eye, drawn))
    if len(rows) < SPECK_PX:
        return None
    return Choice(polygon=commands.box(int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max())))


def in_lasso(measured: Measured, eye: Eye, drawn: NDArray[np.float64]) -> Choice | None:
    """The polygon of the pixels whose points lie in a lasso on the screen, with corners (k, 2); None if too few do."""
    corners = polygon(_inside(measured, eye, drawn))
    return Choice(polygon=corners) if corners else None


def polygon(inside: NDArray[np.bool_]) -> tuple[Pixel, ...]:
    """Corners of a polygon around pixels (height, width): of one patch its contour, of several the hull of all.

    No corners if there is no patch of some size.
    """
    joined = cv2.morphologyEx(inside.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((GAP_PX, GAP_PX), np.uint8))
    contours, _ = cv2.findContours(joined, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    patches = [one for one in contours if cv2.contourArea(one) >= SPECK_PX]
    if not patches:
        return ()
    around = patches[0] if len(patches) == 1 else cv2.convexHull(np.concatenate(patches))
    tolerance_px = SIMPLIFIED_PX
    while len(simple := cv2.approxPolyDP(around, tolerance_px, True)) > MAX_CORNERS:
        tolerance_px *= 1.5
    return tuple((int(column), int(row)) for column, row in simple[:, 0]) if len(simple) >= MIN_CORNERS else ()


def _inside(measured: Measured, eye: Eye, drawn: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Pixels (height, width) whose points lie in a polygon (k, 2) on the screen."""
    points_r = measured.camera.unproject(measured.distance.astype(np.float32)).reshape(-1, 3)
    place = eye.project(points_r)
    x, y = place.T
    inside = np.zeros(len(place), np.bool_)
    for (x1, y1), (x2, y2) in zip(drawn, np.roll(drawn, -1, axis=0)):
        crossed = (y < y1) != (y < y2)  # by the ray to the right; never by NaN, where there is no return
        inside[crossed] ^= x[crossed] < x1 + (y[crossed] - y1) * (x2 - x1) / (y2 - y1)
    return inside.reshape(measured.distance.shape)
