"""From a device's ticks to the host's monotonic clock.

A frame arrives some time after its exposure; the delay varies, but only ever upwards from a least one. So the line
through (ticks, arrival) that lies below all points and as close to them as possible is the device's clock: its slope is
the drift, what lies above it is delay. Such a line maximises the likelihood of exponentially distributed delays, and is
a side of the points' lower convex hull (Moon, Skelly and Towsley, "Estimation and removal of clock skew from network
delay measurements", INFOCOM 1999). Used is the mean of the lines below all points, weighted with their likelihood: it
errs less than the most likely one, above all at the end of the data, which is where it is needed, and it knows by how
much. The least delay itself cannot be observed; a driver that knows it says so.

One mapping belongs to one stream in one epoch: streams of one device may have clocks that drift apart.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.contract.capabilities import ClockInfo

#: Greatest relative error of a device's clock; crystals are within 100 ppm, cheap resonators within 500.
MAX_DRIFT = 500e-6
#: Of so much time only the least delayed frame is kept [ns].
BUCKET_NS = 0.25e9
#: So many of them carry the line: a minute's, so that it may bend with the temperature.
BUCKETS = 240
#: Mean delay that is assumed as if one frame had shown it, because a single one shows nothing [ns].
DELAY_NS = 5e6
#: Slopes around the most likely one that are weighed, in units of the mean delay per frame and span.
_SLOPES = np.linspace(-60.0, 60.0, 61)
#: A frame that arrives so long before it was taken, or frames that are all late by so much, tell of a step [ns].
STEP_NS = 100e6
#: How long all frames have to be late [ns].
PATIENCE_NS = 3e9


@dataclass(frozen=True, slots=True)
class Stamp:
    """When an exposure was, on the host's clock.

    Attributes:
        t_host_ns: CLOCK_MONOTONIC [ns].
        t_sigma_ns: standard deviation of its error, apart from the least delay [ns].
        stepped: whether the device's clock has jumped, so that a new epoch begins with this frame.
    """

    t_host_ns: int
    t_sigma_ns: int
    stepped: bool


@dataclass(slots=True)
class _Bucket:
    """The least delayed frame of a quarter of a second: its time `x` and `y`, how much later than that it came [ns]."""

    begin: float
    x: float
    y: float


class DeviceClock:
    """The mapping of one stream's clock. Memory and time per frame are bounded.

    Args:
        clock: of the stream; its `tick_hz` must not be 0.
        latency_ns: least delay between an exposure and its arrival, if the driver knows it [ns].
    """

    def __init__(self, clock: ClockInfo, latency_ns: int = 0) -> None:
        self._clock = clock
        self._latency_ns = latency_ns
        self._steps = 0
        self._last: tuple[int, int] | None = None  # unwrapped ticks and arrival of the latest frame
        self._begin(0, 0)

    @property
    def gauges(self) -> Mapping[str, float]:
        """`drift_ppm`, positive if the device's clock is slow; `residual_ms`, mean delay above the least; `steps`."""
        return {
            "drift_ppm": self._slope * 1e6,
            "residual_ms": self._residual * 1e-6,
            "steps": float(self._steps),
        }

    def stamp(self, ticks: int, t_arrival_ns: int) -> Stamp:
        """The host time of an exposure.

        Args:
            ticks: the device's counter as it came, not unwrapped.
            t_arrival_ns: when the host had the frame, CLOCK_MONOTONIC [ns].
        """
        first = self._last is None
        unwrapped = self._unwrap(ticks, t_arrival_ns)
        x, y = self._point(unwrapped, t_arrival_ns)
        stepped = not first and self._has_stepped(x, y)
        if first or stepped:
            self._steps += stepped
            self._begin(unwrapped, t_arrival_ns)
            x = y = 0.0
        self._add(x, y)
        late = max(y - self._line(x), 0.0)
        self._residual += (late - self._residual) / min(self._count, 300)
        t_host_ns = t_arrival_ns - round(y - self._line(x)) - self._latency_ns
        return Stamp(t_host_ns, round(self._sigma), stepped)

    def _begin(self, ticks: int, t_arrival_ns: int) -> None:
        self._origin = ticks, t_arrival_ns
        self._buckets: deque[_Bucket] = deque(maxlen=BUCKETS)
        self._slope = 0.0
        self._pivot = self._height = 0.0
        self._sigma = 0.0
        self._residual = 0.0
        self._count = 0
        self._punctual = 0.0  # time of the latest frame that was not late enough to tell of a step

    def _unwrap(self, ticks: int, t_arrival_ns: int) -> int:
        """Ticks that never wrap; how often they did in a long gap is told by the host's clock."""
        if self._last is not None and self._clock.bits:
            turn = 1 << self._clock.bits
            before, t_before_ns = self._last
            expected = before + (t_arrival_ns - t_before_ns) * 1e-9 * self._clock.tick_hz
            ticks += turn * round((expected - ticks) / turn)
        self._last = ticks, t_arrival_ns
        return ticks

    def _point(self, ticks: int, t_arrival_ns: int) -> tuple[float, float]:
        """Time since the origin by the device's nominal rate, and how much later the frame came than that [ns]."""
        x = (ticks - self._origin[0]) / self._clock.tick_hz * 1e9
        return x, (t_arrival_ns - self._origin[1]) - x

    def _line(self, x: float) -> float:
        return self._height + self._slope * (x - self._pivot)

    def _has_stepped(self, x: float, y: float) -> bool:
        residual = y - self._line(x)
        now = x + y  # host time since the origin: the device's own may just have jumped
        if residual < STEP_NS:
            self._punctual = now
        backwards = x < self._buckets[-1].begin
        return backwards or residual < -STEP_NS or now - self._punctual > PATIENCE_NS

    def _add(self, x: float, y: float) -> None:
        self._count += 1
        last = self._buckets[-1] if self._buckets else None
        if last is None or x >= last.begin + BUCKET_NS:
            self._buckets.append(_Bucket(x, x, y))
            self._fit()
            return
        if y < last.y:
            last.x, last.y = x, y
        if y < self._line(x):
            self._fit()

    def _fit(self) -> None:
        x, y = np.array([(bucket.x, bucket.y) for bucket in self._buckets]).T
        self._pivot = float(x.mean())
        slope, height = lower_line(x, y, self._pivot, MAX_DRIFT)
        late = y - height - slope * (x - self._pivot)
        # Mean delay of the points over their number; from the median, so that a host that was busy once does not count.
        lateness = (np.median(late) / np.log(2) + DELAY_NS / len(x)) / max(len(x) - 1, 1)
        slopes = slope + _SLOPES * lateness / max(x[-1] - x[0], BUCKET_NS)
        slopes = slopes[np.abs(slopes) <= MAX_DRIFT]
        heights = np.min(y - slopes[:, None] * (x - self._pivot), axis=1)
        weights = np.exp((heights - height) / lateness)
        weights /= weights.sum()
        self._slope = float(weights @ slopes)
        self._height = float(weights @ heights) - lateness
        ends = heights + slopes * (x[-1] - self._pivot)
        self._sigma = float(np.sqrt(weights @ (ends - weights @ ends) ** 2 + lateness**2))


def lower_line(x: NDArray[np.float64], y: NDArray[np.float64], pivot: float, steepest: float) -> tuple[float, float]:
    """The line below all points that is highest at `pivot`, which is the one nearest to points whose mean is there.

    Args:
        x, y: (n,) points, at least one.
        pivot: between the least and the greatest x, both included.
        steepest: greatest magnitude of the slope.

    Returns:
        Slope, and height at the pivot.
    """
    left, right = x < pivot, x > pivot
    slope = 0.0
    if left.any() and right.any():
        # Of all chords across the pivot, the lowest there is the side of the lower convex hull.
        run = x[right] - x[left][:, None]
        slopes = (y[right] - y[left][:, None]) / run
        heights = y[left][:, None] + slopes * (pivot - x[left][:, None])
        slope = float(slopes.flat[np.argmin(heights)])
    slope = float(np.clip(slope, -steepest, steepest))
    return slope, float(np.min(y - slope * (x - pivot)))
