"""Classification of the depth images of one sensor, with the missing returns of its first image."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from abs_service.pairing.images import Window
from abs_service.tracker.detection.dropouts import dropouts
from abs_service.tracker.terms.depth.classification.background import Background
from abs_service.tracker.terms.depth.classification.beyond_view import BeyondView
from abs_service.tracker.terms.depth.classification.fixed_edges import FixedEdges
from abs_service.tracker.terms.depth.classification.interruption import interruptions
from abs_service.tracker.terms.depth.classification.nearest_range import NearestRange
from abs_service.tracker.terms.depth.classification.separation import separates, separating_step
from abs_service.tracker.terms.depth.classification.visibility import (
    AGREEMENT_M,
    MAX_STEP_M,
    Visibility,
    classify,
    surfaces_of,
)
from calib.camera import Camera


class Classifier:
    """Knows from the first image where the background gives no return, and where field of view, range and object end.

    Args:
        camera: the depth camera.
    """

    def __init__(self, camera: Camera) -> None:
        self._focal = camera.fx
        self._background, self._beyond_view = Background(), BeyondView()
        self._nearest_range, self._fixed_edges = NearestRange(camera), FixedEdges()
        self._begun, self._is_interrupted, self._step = False, True, MAX_STEP_M

    def classify(
        self, distance: NDArray[np.float32], expected: NDArray[np.float32], window: Window, shape: tuple[int, ...]
    ) -> Visibility:
        """The classes of the pixels in a window of an image; the first one has to be the whole image.

        Args:
            distance: measured radial distances (rows, columns) [m], NaN without return.
            expected: radial distances of the predicted mesh there [m], infinite beside it.
            window: of the image.
            shape: of the image (height, width).
        """
        missing, silhouette = np.isnan(distance), np.isfinite(expected)
        beyond, single = self._beyond_view.observe(missing, silhouette, window), dropouts(missing)
        areas = missing & ~single
        beyond |= self._nearest_range.observe(distance, areas & ~beyond, silhouette, window)
        beyond |= self._fixed_edges.observe(missing, areas & ~beyond, silhouette, window)
        areas &= ~beyond
        if not self._begun:
            self._step = separating_step(distance, silhouette)
        # A flat thing that is lifted ends as others do, and its surface may be steep then.
        is_flat = self._step < MAX_STEP_M and not separates(MAX_STEP_M, distance, silhouette)
        step = self._step if is_flat else MAX_STEP_M
        surfaces = surfaces_of(distance, step)
        # What the surface goes on beyond is a hole, not the background. If there is none at first, none is looked for.
        hole = interruptions(surfaces, areas, silhouette) if self._is_interrupted else np.False_
        if not self._begun:
            self._begun, self._is_interrupted = True, bool(hole.any())
        empty, lost = self._background.observe(areas & ~hole, silhouette, window, shape)
        given = expected, self._focal, empty, single, beyond
        seen = classify(surfaces, *given, agreement=AGREEMENT_M * (step / MAX_STEP_M))
        if is_flat and not seen.object.any():  # it moved farther than a finer agreement allows for
            seen = classify(surfaces_of(distance), *given)
        unsettled = self._fixed_edges.unsettled[window]
        return replace(seen, hole=seen.hole | hole, unsettled=unsettled, lost=lost)
