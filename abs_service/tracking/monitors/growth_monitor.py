"""Growth of the mesh: an object that something hid at first is detected again once more of it is in sight."""

from collections.abc import Sequence

from abs_service.tracker.terms.sensor_fit import SensorFit

#: Share of the covered edges beyond which the object must continue, and their least number.
MIN_SHARE, MIN_VERTICES = 0.5, 4

#: The new mesh replaces the old one if its area is larger by this factor.
MIN_GROWTH = 1.1


class GrowthMonitor:
    """Decides when a new mesh is due; one for each mesh.

    Args:
        after_s: time for which the object must be seen to continue beyond the mesh [s].
    """

    def __init__(self, after_s: float):
        self._after_s = after_s
        self._since_ns: int | None = None
        self._tried = False

    def take_attempt(self, fits: Sequence[SensorFit], t_ns: int) -> bool:
        """True, once, when the object has continued beyond covered edges of the mesh for long enough at `t_ns` [ns]."""
        covered = sum(fit.rim.covered for fit in fits)
        uncovered = sum(fit.rim.uncovered for fit in fits)
        if uncovered < max(MIN_VERTICES, MIN_SHARE * covered):
            self._since_ns = None
            return False
        self._since_ns = t_ns if self._since_ns is None else self._since_ns
        if self._tried or t_ns - self._since_ns < self._after_s * 1e9:
            return False
        self._tried = True
        return True
