"""Arrival of an object: what comes into view over the image's border is waited for until it has come."""

from collections import deque
from collections.abc import Callable

import numpy as np

from abs_service.tracker.detection.initial_detection import DetectionError, InitialDetection, UndecidedError
from abs_service.tracker.detection.plausibility import at_border

#: Largest growth of an object's number of pixels within a time [ns], once all of it is in sight.
GROWTH, SETTLED_NS = 1.05, 300_000_000

#: What was found longer ago says nothing of how it comes into view now [ns].
KEPT_NS = 1_000_000_000


class ArrivalMonitor:
    """Delays the detection of an object that moves into the image, until all of it is in sight.

    A mesh of the first fingertips, or of the first corner of a sheet, would be of no use. The very first image is taken
    as it is: nothing tells whether what it cuts off comes or stays.
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque()

    def checked(self, detect: Callable[[], InitialDetection], t_ns: int) -> InitialDetection:
        """The object that `detect` finds in the image of a time, CLOCK_MONOTONIC [ns].

        Raises:
            UndecidedError: the image's border cuts it, and more and more of it is in sight.
            DetectionError: as `detect`.
        """
        while self._seen and not 0 <= t_ns - self._seen[0][0] <= KEPT_NS:
            self._seen.popleft()
        before = self._before(t_ns)
        try:
            found = detect()
        except DetectionError:
            self._seen.append((t_ns, 0))
            raise
        inside = np.isfinite(found.distance)
        pixels = int(np.count_nonzero(inside))
        self._seen.append((t_ns, pixels))
        if pixels > GROWTH * before and at_border(inside, np.isfinite(found.surroundings)).any():
            raise UndecidedError(
                f"an object comes into view over the image's border: {pixels} of its pixels are in sight, "
                f"{before} were {SETTLED_NS * 1e-9:g} s ago"
            )
        return found

    def _before(self, t_ns: int) -> float:
        """Number of pixels `SETTLED_NS` before a time [ns], or as long as it is known; infinite if it is not."""
        settled = [pixels for seen_ns, pixels in self._seen if t_ns - seen_ns >= SETTLED_NS]
        return settled[-1] if settled else self._seen[0][1] if self._seen else np.inf
