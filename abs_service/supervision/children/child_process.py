"""Child processes of the supervisor: each in its own process group, with a parent watchdog and its last output."""

import contextlib
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Protocol

from abs_service.supervision.children import forked

#: Lines of a child's output that are kept.
TAIL_LINES = 40


@dataclass(frozen=True, slots=True)
class ThreadTimes:
    """Time that a thread has run, and has waited for a processor before it ran last [ns]; whether it would run now."""

    ran_ns: int = 0
    waited_ns: int = 0
    runnable: bool = False


class Process(Protocol):
    """A process that runs or has ended."""

    @property
    def pid(self) -> int:
        """Number of the process; 0 if there is none."""
        ...

    def poll(self) -> int | None:
        """The exit code, negative for a signal; None while it runs."""
        ...

    def threads(self) -> Mapping[int, ThreadTimes]:
        """Processor times of its threads so far, by their number."""
        ...

    def terminate(self) -> None:
        """Sends SIGTERM; no effect if it has ended."""
        ...

    def kill(self) -> None:
        """Kills its process group; no effect if it has ended."""
        ...

    def wake(self) -> None:
        """Writes it a line, see `parent_watchdog`; no effect if it has ended."""
        ...

    def output_tail(self) -> str:
        """Last lines of its output."""
        ...


class _NoProcess:
    """Null object for no process."""

    pid = 0

    def poll(self) -> int:
        """Exit code 0: there is no process."""
        return 0

    def threads(self) -> Mapping[int, ThreadTimes]:
        """No threads."""
        return {}

    def terminate(self) -> None:
        """No operation: there is no process."""

    def kill(self) -> None:
        """No operation: there is no process."""

    def wake(self) -> None:
        """No operation: there is no process."""

    def output_tail(self) -> str:
        """Empty."""
        return ""


NO_PROCESS: Process = _NoProcess()

#: Starts a component (its name is for the lines it writes) with arguments of `abs-service`.
Spawn = Callable[[str, Sequence[str]], Process]


class ChildProcess:
    """`abs-service ARGUMENTS` as a child of the fork server, which has imported what it needs; see `forked.preload`.

    Args:
        component: its name.
        arguments: the command line after `abs-service`.
        on_line: called with the component and each line that the child writes, from a thread.
        program: runs the arguments in the child; a function of a module.
    """

    def __init__(
        self,
        component: str,
        arguments: Sequence[str],
        on_line: Callable[[str, str], None],
        program: Callable[[Sequence[str]], None] = forked.abs_service,
    ) -> None:
        self._lines: deque[str] = deque(maxlen=TAIL_LINES)
        stdin, self._to_child = forked.CONTEXT.Pipe(duplex=False)
        self._from_child, output = forked.CONTEXT.Pipe(duplex=False)
        with stdin, output:
            self._process = forked.CONTEXT.Process(
                target=forked.begin, args=(stdin, output, program, list(arguments)), name=component, daemon=True
            )
            try:
                self._process.start()
            except (EOFError, ConnectionError) as error:  # another one is started the next time
                killed = "somebody has killed it, or the system for want of memory"
                raise OSError(f"the fork server has ended: {killed}") from error
        self._ended, self._code = _end_of(self._process), None  # exit code
        self._reader = threading.Thread(target=self._read, args=(component, on_line), name=component, daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """See `Process`."""
        return self._process.pid or 0

    def poll(self) -> int | None:
        """See `Process`."""
        if self._code is None and wait([self._ended], 0.0):
            self._code = self._exit_code()
        return self._code

    def threads(self) -> Mapping[int, ThreadTimes]:
        """See `Process`; empty if it has ended, or where the kernel does not say (/proc/PID/task/*/schedstat)."""
        threads: dict[int, ThreadTimes] = {}
        with contextlib.suppress(OSError):
            for task in Path(f"/proc/{self.pid}/task").iterdir():
                with contextlib.suppress(OSError):  # the thread has ended
                    threads[int(task.name)] = _thread_times(task)
        return threads

    def terminate(self) -> None:
        """See `Process`."""
        self._send(os.kill, signal.SIGTERM)

    def kill(self) -> None:
        """See `Process`."""
        self._send(os.killpg, signal.SIGKILL)
        self._send(os.kill, signal.SIGKILL)  # one that has not got its group yet
        if wait([self._ended], 1.0):  # else it is stuck in the kernel, say in a driver
            self._process.join(1.0)

    def wake(self) -> None:
        """See `Process`."""
        with contextlib.suppress(OSError):  # of a pipe that is closed after its end
            os.write(self._to_child.fileno(), b"\n")

    def output_tail(self) -> str:
        """See `Process`; waits until all that an ended process wrote has been read."""
        self._reader.join(timeout=1.0)
        return "\n".join(self._lines)

    def _exit_code(self) -> int | None:
        try:
            return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        except ChildProcessError:  # as long as the fork server lives, it is the parent
            return self._process.exitcode

    def _send(self, send: Callable[[int, int], None], number: signal.Signals) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                send(self.pid, number)

    def _read(self, component: str, on_line: Callable[[str, str], None]) -> None:
        # Leaving the latter closes the watchdog's pipe.
        with self._from_child, self._to_child:
            with open(self._from_child.fileno(), closefd=False, encoding="utf-8", errors="replace") as output:
                for line in output:
                    self._lines.append(line.rstrip("\n"))
                    on_line(component, line.rstrip("\n"))
            wait([self._ended])


def _end_of(process: ForkServerProcess) -> Connection | int:
    """A descriptor that can be read when a process has ended, also if the fork server is gone."""
    try:
        return Connection(os.pidfd_open(process.pid or 0), writable=False)  # which closes itself
    except ProcessLookupError:  # already
        return process.sentinel


def longest_wait_ns(before: Mapping[int, ThreadTimes], now: Mapping[int, ThreadTimes], elapsed_ns: int) -> int:
    """Longest time that a thread has waited for a processor within the elapsed time [ns]."""
    waits_ns = [0]
    for thread, times in now.items():
        earlier = before.get(thread, ThreadTimes())
        # The kernel counts a wait when it is over; a thread that would run now has waited since it ran last.
        waited_ns = elapsed_ns if times.runnable else times.waited_ns - earlier.waited_ns
        waits_ns.append(min(waited_ns, elapsed_ns - (times.ran_ns - earlier.ran_ns)))
    return max(waits_ns)


def _thread_times(task: Path) -> ThreadTimes:
    ran, waited, _ = (task / "schedstat").read_text(encoding="ascii").split()
    # After the name in brackets, which may hold anything.
    state = (task / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()[0]
    return ThreadTimes(int(ran), int(waited), state == "R")
