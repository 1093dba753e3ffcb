"""Times of the images: the time stamps of a file where they are any, and a rate where they are not.

Many of ScanNet's files hold zeros, and some of them a few random numbers among these (issues 9 and 39 of
ScanNet/ScanNet). The stamps of a kind of images are believed if they increase from every frame to the next.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from drivers.sens.places import FramePlaces

#: Largest time stamp of which there are nanoseconds in 64 bits [µs].
_MAX_TIME_US = (2**63 - 1) // 1000


@dataclass(frozen=True, slots=True)
class Times:
    """Tells the times of images.

    Attributes:
        clocks: kind of images whose time stamps are taken, by kind; empty if none are.
        rate_hz: frames per second without time stamps.
        problem: what is wrong with the time stamps, and what is taken for them; "" if nothing is.
    """

    clocks: Mapping[str, str]
    rate_hz: float
    problem: str = ""

    def ticks(self, frame: FramePlaces, name: str) -> int | None:
        """Time stamp of an image [µs], None without one."""
        return frame.images[self.clocks[name]].time_us if name in self.clocks else None

    def time_ns(self, frame: FramePlaces, name: str) -> int:
        """Time of an image [ns]."""
        ticks = self.ticks(frame, name)
        return round(frame.number * 1e9 / self.rate_hz) if ticks is None else ticks * 1000


class Stamps:
    """Judges the time stamps of the frames that it is given."""

    def __init__(self) -> None:
        self._last_us: dict[str, int] = {}
        self._problems: dict[str, str] = {}

    def add(self, frame: FramePlaces) -> None:
        """Takes the next frame."""
        for name, image in frame.images.items():
            last_us = self._last_us.get(name, -1)
            if not last_us < image.time_us <= _MAX_TIME_US:
                after = f" after {last_us} µs" if last_us >= 0 else ""
                self._problems.setdefault(name, f"{name} of frame {frame.number} is of {image.time_us} µs{after}")
            self._last_us[name] = image.time_us

    def times(self, names: Collection[str], rate_hz: float) -> Times:
        """The times of all images.

        Args:
            names: kinds of images that there are.
            rate_hz: frames per second, if no kind has believable stamps.
        """
        problems = [self._problems[name] for name in names if name in self._problems]
        believed = [name for name in names if name not in self._problems]
        # Where only one of the two has stamps, the other's image is of the same moment.
        clocks = {name: name if name in believed else believed[0] for name in names} if believed else {}
        instead = f"those of {believed[0]} are taken" if believed else f"{rate_hz:g} frames per second are assumed"
        problem = f"time stamps do not increase ({problems[0]}): {instead}" if problems else ""
        return Times(clocks, rate_hz, problem)
