"""One process of a rig as the supervisor sees it."""

import signal
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from abs_service.supervision.children.child_process import NO_PROCESS, Process, ThreadTimes, longest_wait_ns
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.process_setup import log_lines

#: A label of the health of `run` for each process, after which the component's name follows: its state, and why.
PROCESS = "process."

#: First backoff before a restart [ns].
FIRST_BACKOFF_NS = 200_000_000
#: Time between two checks whether a process that starts or compiles does anything; the first is earlier than its next
#: health is due, so that the second still reports within two seconds [ns].
FIRST_POLL_NS, POLL_NS = 1_000_000_000, 800_000_000


class ChildState(StrEnum):
    """State of a child process."""

    RUNNING = "running"
    BACKOFF = "backoff"  # not started yet, or ended; starts when its backoff is over
    STALLED = "stalled"  # sent no health in time and was killed; will be restarted
    RENEWED = "renewed"  # was asked to end, and starts again as soon as it has
    FINISHED = "finished"  # there is nothing left for it to do
    FAILED = "failed"  # given up for a while
    STOPPED = "stopped"


@dataclass
class Child:
    """One supervised process.

    Attributes:
        component: its name in health: capture, track/<tracker>, record.
        arguments: its command line after `abs-service`.
        stage: children of lower stages are stopped first.
        state: its state.
        reason: of the state, in plain words.
        restarts: how often it was started again after a failure.
        starts: how often it was started.
        lacks: it cannot work, because the host lacks something, such as open files, or a file of it is wrong; until it
            is started, or sends health.
        process: the running one; `NO_PROCESS` if there is none.
        exit_code: of its last end.
        worst_code: the highest with which it ended by itself or on request; 128 + N for signal N that ended it after a
            request. A crash counts as a restart only.
        overdue_ns, deadline_ns: without health until then it is said, and it is killed [ns].
        busy: it starts or compiles, and need not send health until `limit_ns` as long as it does anything.
    """

    component: str
    arguments: tuple[str, ...]
    stage: int
    state: ChildState = ChildState.BACKOFF
    reason: str = ""
    restarts: int = 0
    starts: int = 0
    lacks: bool = False
    exit_code: int = 0
    worst_code: int = 0
    process: Process = field(default=NO_PROCESS, repr=False)
    overdue_ns: int = 0
    deadline_ns: int = 0
    started_ns: int = 0
    backoff_ns: int = FIRST_BACKOFF_NS // 2
    start_at_ns: int = 0
    received_ns: int = 0
    busy: bool = False
    limit_ns: int = 0
    threads: Mapping[int, ThreadTimes] = field(default_factory=dict, repr=False)
    looked_at: Mapping[int, ThreadTimes] = field(default_factory=dict, repr=False)
    exits_ns: deque[int] = field(default_factory=deque, repr=False)

    @property
    def condition(self) -> str:
        """State and its reason, in words."""
        return f"{self.state.value}: {self.reason}" if self.reason else self.state.value

    @property
    def awaits_correction(self) -> bool:
        """True if a file of it was wrong when it started again, which somebody has to put right."""
        return self.lacks and self.exit_code == Exit.USER

    def waited_ns(self, now_ns: int) -> int:
        """Longest time that one of its threads has waited for a processor since its last health [ns]."""
        return longest_wait_ns(self.threads, self.process.threads(), now_ns - self.received_ns)

    def is_overdue(self, now_ns: int, patience_ns: int) -> bool:
        """True if its health should have come.

        A busy one, which is killed after `limit_ns` only, has a patience as long as it runs; a look now and then tells.
        A kernel that does not say whether threads have run is taken to say so.
        """
        if now_ns < self.overdue_ns or not self.busy:
            return now_ns >= self.overdue_ns
        before, self.looked_at = self.looked_at, self.process.threads()
        self.overdue_ns = now_ns + POLL_NS
        runs = self.looked_at != before or any(thread.runnable for thread in self.looked_at.values())
        if not self.looked_at or runs:
            self.deadline_ns = self.limit_ns
            return False
        self.deadline_ns = min(now_ns + patience_ns, self.deadline_ns)
        return True

    def end(self) -> None:
        """Keeps the exit code of a process that was asked to end, and kills it if it has not; no effect without one."""
        if self.process is NO_PROCESS:
            return
        self.process.kill()
        code = self.process.poll()
        self.exit_code = -signal.SIGKILL if code is None else code  # None: it is stuck in the kernel
        # Processes end in order by SIGTERM, unless they have not begun.
        counted = 0 if self.exit_code == -signal.SIGTERM else self.exit_code
        self.worst_code = max(self.worst_code, counted if counted >= 0 else 128 - counted)
        self.process = NO_PROCESS


def exit_reason(code: int, output_tail: str) -> str:
    """The end of a process in words: its exit code or signal, and its error, or the last line that it wrote."""
    if code == -signal.SIGKILL:  # nothing that it wrote is the reason
        return "ended by signal 9: somebody has killed it, or the system for want of memory"
    how = f"ended by signal {-code}" if code < 0 else f"ended with code {code}"
    lines = output_tail.strip().split("\n")
    # The error, also if something was said after it, such as which threads do not end.
    last = log_lines.message([*lines, *(line for line in lines if log_lines.is_final(line))][-1])
    return f"{how}: {last}" if last else how
