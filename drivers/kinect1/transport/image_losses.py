"""Warns when too many images are lost."""

from collections.abc import Callable

#: Length of the window [ns], and tolerated fraction of lost images.
WINDOW_NS, TOLERATED = 10_000_000_000, 0.05

#: Name of the condition, and its remedy.
CONDITION = "lost images"
_REMEDY = "attach the Kinect to a USB controller of its own, without hubs, and check its cable"


class ImageLosses:
    """Warns when more than `TOLERATED` of a window's images were dropped; clears the warning when not.

    Args:
        clock: CLOCK_MONOTONIC [ns].
        warn: see `drivers.contract.device.Sink.on_warning`.
    """

    def __init__(self, clock: Callable[[], int], warn: Callable[[str, str], None]) -> None:
        self._clock = clock
        self._warn = warn
        self._begin_ns = clock()
        self._before = (0, 0)
        self._warned = False

    def update(self, delivered: int, dropped: int) -> None:
        """Updates the total numbers of delivered and dropped images."""
        if self._clock() - self._begin_ns < WINDOW_NS:
            return
        came, lost = delivered - self._before[0], dropped - self._before[1]
        self._begin_ns, self._before = self._clock(), (delivered, dropped)
        if lost > TOLERATED * (came + lost):
            self._warned = True
            self._warn(CONDITION, f"{lost} of {came + lost} images were lost in {WINDOW_NS / 1e9:g} s; {_REMEDY}")
        elif self._warned:
            self._warned = False
            self._warn(CONDITION, "")
