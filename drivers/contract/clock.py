"""Estimates the mapping from a device's ticks to the host's monotonic clock.

A frame arrives after its exposure with a random delay that has a lower bound. The line through (ticks, arrival) that
lies below all points and as close to them as possible is therefore the device's clock: its slope is the clock drift,
the distances above it are delays. This line is the maximum likelihood estimate for exponentially distributed delays,
and a side of the points' lower convex hull (Moon, Skelly and Towsley, "Estimation and removal of clock skew from
network delay measurements", INFOCOM 1999). We use the posterior mean over all lines below the points instead: its error
is smaller, above all at the end of the data, where it is needed, and it comes with a standard deviation. The minimum
delay itself is not observable; a driver that has a value for it passes it in.

Each stream has its own mapping per epoch, because the clocks of one device's streams may drift apart.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.contract.capabilities import ClockInfo

#: Maximum relative frequency error of a device's clock; crystals are within 100 ppm, cheap resonators within 500 ppm.
MAX_DRIFT = 500e-6
#: Length of a bucket; only its frame with the minimum delay is kept [ns].
BUCKET_NS = 0.25e9
#: Number of buckets in the fit: one minute, so that the estimate follows temperature drift.
BUCKETS = 240
#: Prior mean delay, with the weight of one observation [ns].
PRIOR_DELAY_NS = 5e6
#: Grid of slopes around the most likely one for the posterior mean, in units of mean delay per frame over time span.
_SLOPES = np.linspace(-60.0, 60.0, 61)
#: Clock step threshold: one frame this early, or all frames this late for `STEP_TIMEOUT_NS`, is a clock step [ns].
STEP_NS = 100e6
#: Duration for which all frames must be late to count as a clock step [ns].
STEP_TIMEOUT_NS = 3e9


@dataclass(frozen=True, slots=True)
class Stamp:
    """Host time of an exposure.

    Attributes:
        t_host_ns: CLOCK_MONOTONIC [ns].
        t_sigma_ns: standard deviation of its error, excluding the unobservable minimum delay [ns].
        stepped: True if the device's clock has jumped; a new epoch begins with this frame.
    """

    t_host_ns: int
    t_sigma_ns: int
    stepped: bool


class Mapped(Protocol):
    """A mapping to host times that measures itself."""

    @property
    def gauges(self) -> Mapping[str, float]:
        """Measurements of the clock, by name."""
        ...


def stream_gauges(clocks: Iterable[tuple[tuple[str, str], Mapped]]) -> dict[str, float]:
    """Gauges of the clock mappings of streams (sensor, stream), as `clock.<sensor>/<stream>.<name>`."""
    return {
        f"clock.{sensor}/{stream}.{name}": value
        for (sensor, stream), clock in clocks
        for name, value in clock.gauges.items()
    }


@dataclass(slots=True)
class _Bucket:
    """Frame with the minimum delay in a bucket: its device time `x` and its delay `y` [ns]."""

    begin: float
    x: float
    y: float


class DeviceClock:
    """Online clock mapping of one stream, with bounded memory and time per frame.

    Args:
        clock: of the stream; its `tick_hz` must not be 0.
    """

    def __init__(self, clock: ClockInfo) -> None:
        self._clock = clock
        self._steps = 0
        self._last: tuple[int, int] | None = None  # unwrapped ticks and arrival of the latest frame
        self._begin(0, 0)

    @property
    def gauges(self) -> Mapping[str, float]:
        """`drift_ppm`, positive if the device's clock is slow; `residual_ms`, mean delay above the minimum; `steps`."""
        return {
            "drift_ppm": self._slope * 1e6,
            "residual_ms": self._residual * 1e-6,
            "steps": float(self._steps),
        }

    def stamp(self, ticks: int, t_arrival_ns: int) -> Stamp:
        """The host time of an exposure.

        Args:
            ticks: raw device counter, not unwrapped.
            t_arrival_ns: host time at which the frame arrived, CLOCK_MONOTONIC [ns].
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
        delay = max(y - self._line(x), 0.0)
        self._residual += (delay - self._residual) / min(self._count, 300)
        t_host_ns = t_arrival_ns - round(y - self._line(x))
        return Stamp(t_host_ns, round(self._sigma), stepped)

    def _begin(self, ticks: int, t_arrival_ns: int) -> None:
        self._origin = ticks, t_arrival_ns
        self._buckets: deque[_Bucket] = deque(maxlen=BUCKETS)
        self._slope = 0.0
        self._pivot = self._height = 0.0
        self._sigma = 0.0
        self._residual = 0.0
        self._count = 0
        self._last_on_time = 0.0  # time of the latest frame whose delay is below the step threshold

    def _unwrap(self, ticks: int, t_arrival_ns: int) -> int:
        """Unwrapped ticks; the host's clock gives the number of wraps in a long gap."""
        if self._last is not None and self._clock.bits:
            turn = 1 << self._clock.bits
            before, t_before_ns = self._last
            expected = before + (t_arrival_ns - t_before_ns) * 1e-9 * self._clock.tick_hz
            ticks += turn * round((expected - ticks) / turn)
        self._last = ticks, t_arrival_ns
        return ticks

    def _point(self, ticks: int, t_arrival_ns: int) -> tuple[float, float]:
        """Time since the origin at the nominal tick rate, and the arrival delay relative to it [ns]."""
        x = (ticks - self._origin[0]) / self._clock.tick_hz * 1e9
        return x, (t_arrival_ns - self._origin[1]) - x

    def _line(self, x: float) -> float:
        return self._height + self._slope * (x - self._pivot)

    def _has_stepped(self, x: float, y: float) -> bool:
        residual = y - self._line(x)
        now = x + y  # host time since the origin: the device time itself may have jumped
        if residual < STEP_NS:
            self._last_on_time = now
        backwards = x < self._buckets[-1].begin
        return backwards or residual < -STEP_NS or now - self._last_on_time > STEP_TIMEOUT_NS

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
        delays = y - height - slope * (x - self._pivot)
        # Scale of the exponential distribution over the number of points; from the median, which is robust to a busy
        # host.
        delay_scale = (np.median(delays) / np.log(2) + PRIOR_DELAY_NS / len(x)) / max(len(x) - 1, 1)
        slopes = slope + _SLOPES * delay_scale / max(x[-1] - x[0], BUCKET_NS)
        slopes = slopes[np.abs(slopes) <= MAX_DRIFT]
        heights = np.min(y - slopes[:, None] * (x - self._pivot), axis=1)
        weights = np.exp((heights - height) / delay_scale)
        weights /= weights.sum()
        self._slope = float(weights @ slopes)
        self._height = float(weights @ heights) - delay_scale
        ends = heights + slopes * (x[-1] - self._pivot)
        self._sigma = float(np.sqrt(weights @ (ends - weights @ ends) ** 2 + delay_scale**2))


def lower_line(x: NDArray[np.float64], y: NDArray[np.float64], pivot: float, steepest: float) -> tuple[float, float]:
    """Line below all points that is highest at `pivot`; if the points' mean is there, it is the closest such line.

    Args:
        x, y: (n,) points, at least one.
        pivot: between the minimum and the maximum of x, inclusive.
        steepest: maximum magnitude of the slope.

    Returns:
        Slope, and height at the pivot.
    """
    left, right = x < pivot, x > pivot
    slope = 0.0
    if left.any() and right.any():
        # The chord across the pivot that is lowest there is a side of the lower convex hull.
        run = x[right] - x[left][:, None]
        slopes = (y[right] - y[left][:, None]) / run
        heights = y[left][:, None] + slopes * (pivot - x[left][:, None])
        slope = float(slopes.flat[np.argmin(heights)])
    slope = float(np.clip(slope, -steepest, steepest))
    return slope, float(np.min(y - slope * (x - pivot)))
