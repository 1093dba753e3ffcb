"""A second process of one component that is loaded and waits, so that it takes over as soon as the first one ends."""

import threading
from collections.abc import Callable, Sequence

from abs_service.supervision.child_process import Process, Spawn

#: Time from the start of a process to that of the one that waits: loading it would slow the start of all [s].
DELAY_S = 5.0


class Standby:
    """A `Spawn` that keeps one process of a component waiting.

    Args:
        component: its name.
        spawn: starts a process of any component.
        prepare: starts a process that is loaded, and waits until it is woken.
        delay_s: time from the start of a process to that of the one that waits [s].
    """

    def __init__(
        self,
        component: str,
        spawn: Spawn,
        prepare: Callable[[str, Sequence[str]], Process],
        delay_s: float = DELAY_S,
    ) -> None:
        self._component, self._spawn, self._prepare, self._delay_s = component, spawn, prepare, delay_s
        self._lock = threading.Lock()
        self._waiting: list[Process] = []  # one at most
        self._timer = threading.Timer(0.0, str)

    def __call__(self, component: str, arguments: Sequence[str]) -> Process:
        """Starts a process of the component, or wakes the one that waits, if it is loaded."""
        if component != self._component:
            return self._spawn(component, arguments)
        with self._lock:
            self._timer.cancel()
            ready = [process for process in self._waiting if _is_loaded(process)]
            for process in self._waiting:
                if process not in ready:
                    process.kill()
            self._waiting = []
            self._timer = threading.Timer(self._delay_s, self._prepare_one, (component, arguments))
            self._timer.daemon = True
            self._timer.start()
        if not ready:
            return self._spawn(component, arguments)
        ready[0].wake()
        return ready[0]

    def close(self) -> None:
        """Ends the process that waits."""
        with self._lock:
            self._timer.cancel()
            self._component = ""
            for process in self._waiting:
                process.kill()

    def _prepare_one(self, component: str, arguments: Sequence[str]) -> None:
        with self._lock:
            if component == self._component and not self._waiting:
                self._waiting.append(self._prepare(component, arguments))


def _is_loaded(process: Process) -> bool:
    """True for one that runs and waits; one that still loads, at the lowest priority, may take very long."""
    return process.poll() is None and not any(times.runnable for times in process.threads().values())
