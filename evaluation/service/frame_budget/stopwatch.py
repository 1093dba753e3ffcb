"""Times stages of a program from outside: functions are wrapped while it is measured, and put back afterwards."""

import functools
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Seam:
    """A function whose time belongs to a stage.

    Attributes:
        stage: name of the stage.
        owner: class or module that has the function.
        name: of the function.
    """

    stage: str
    owner: Any
    name: str


class Stopwatch:
    """Exclusive times of stages: what a stage calls of other stages counts for those.

    Args:
        clock: nanoseconds; CPU time of the process, so that others on the machine do not count.

    Attributes:
        laps: times of every stage [ns], one dictionary for each call of `lap`.
    """

    def __init__(self, clock: Callable[[], int] = time.process_time_ns):
        self.laps: list[dict[str, int]] = []
        self._clock = clock
        self._running: list[str] = []
        self._since_ns = 0
        self._spent_ns: dict[str, int] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time until the end of the block is that of a stage."""
        self._charge()
        self._running.append(name)
        try:
            yield
        finally:
            self._charge()
            self._running.pop()

    def lap(self) -> None:
        """Ends a lap, such as a frame: what was spent since the last one."""
        self.laps.append(self._spent_ns)
        self._spent_ns = {}

    @contextmanager
    def watching(self, seams: Sequence[Seam]) -> Iterator[None]:
        """Wraps functions until the end of the block."""
        originals = [(seam, vars(seam.owner)[seam.name]) for seam in seams]
        try:
            for seam, original in originals:
                setattr(seam.owner, seam.name, self._wrapped(seam.stage, original))
            yield
        finally:
            for seam, original in originals:
                setattr(seam.owner, seam.name, original)

    def _wrapped(self, stage: str, original: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(original)
        def timed(*arguments: Any, **named: Any) -> Any:
            with self.stage(stage):
                return original(*arguments, **named)

        return timed

    def _charge(self) -> None:
        """Charges the time since the last change to the stage that runs."""
        now_ns = self._clock()
        if self._running:
            stage = self._running[-1]
            self._spent_ns[stage] = self._spent_ns.get(stage, 0) + now_ns - self._since_ns
        self._since_ns = now_ns
