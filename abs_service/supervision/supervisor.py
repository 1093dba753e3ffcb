"""Starts the processes of a rig, restarts those that end or stall, and stops them in order.

A state machine without threads: the caller calls `poll` periodically; clock and process creation are passed in.
"""

import logging
from collections.abc import Callable, Iterable

from abs_service.supervision.children.child import FIRST_BACKOFF_NS, FIRST_POLL_NS, Child, ChildState, exit_reason
from abs_service.supervision.children.child_process import NO_PROCESS, Spawn
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.limits import Limits
from abs_service.supervision.repeats import Repeats, counted

_log = logging.getLogger(__name__)

#: Longest backoff before a restart: it doubles with each end of a process soon after its start [ns].
MAX_BACKOFF_NS = 3_000_000_000
#: After a run that was longer than this a process is started again at once, and the next backoff is the first one [ns].
WORKED_NS = 10_000_000_000
#: Time without health of a process, which is due once a second, after which it is overdue [ns].
OVERDUE_NS = 1_800_000_000
#: If `poll` was not called for longer than this, the supervisor itself was suspended, and received no health [ns].
PAUSE_NS = 1_000_000_000


class Supervisor:
    """Supervises child processes.

    Args:
        children: the processes; started by the first `poll`.
        spawn: starts a process.
        clock: monotonic time [ns].
        limits: when to restart and when to give up.
    """

    def __init__(
        self, children: Iterable[Child], spawn: Spawn, clock: Callable[[], int], limits: Limits | None = None
    ) -> None:
        self.children = {child.component: child for child in children}
        self._spawn = spawn
        self._clock = clock
        self._limits = limits or Limits()
        self._leaving: list[Child] = []
        self._polled_ns = clock()
        self._repeats = Repeats()

    def poll(self) -> None:
        """Starts, restarts and gives up children as due."""
        now_ns = self._clock()
        self._excuse_pause(now_ns)
        for child in [one for one in self._leaving if one.process.poll() is not None or now_ns >= one.start_at_ns]:
            child.end()
            self._leaving.remove(child)
        for child in self.children.values():
            if child.state is ChildState.RUNNING:
                self._check(child, now_ns)
            if child.state is ChildState.RENEWED and child.process.poll() is not None:
                child.start_at_ns = now_ns
            waits = child.state in (ChildState.BACKOFF, ChildState.STALLED, ChildState.RENEWED, ChildState.FAILED)
            if waits and now_ns >= child.start_at_ns:
                child.restarts += child.state is ChildState.FAILED
                self._start(child, now_ns)

    def processes(self) -> frozenset[int]:
        """Numbers of the processes that run."""
        return frozenset(one.process.pid for one in (*self.children.values(), *self._leaving)) - {NO_PROCESS.pid}

    def heartbeat(self, component: str, busy: bool = False) -> None:
        """Extends a component's deadline; further for a busy one, which compiles kernels."""
        child = self.children.get(component)
        if child is not None and child.state is ChildState.RUNNING:
            self._expect_health(child, self._clock(), busy)
            child.threads, child.reason, child.lacks = child.process.threads(), "", False

    def renew(self, component: str) -> None:
        """Ends a process in order, and starts it again, which is no failure; also one that was given up."""
        child = self.children[component]
        if child.state is ChildState.RENEWED:
            return  # it has been signalled, and a second SIGTERM would end it on the spot
        child.process.terminate()
        child.exits_ns.clear()
        child.state, child.reason = ChildState.RENEWED, "starts again with the configuration that was read"
        child.start_at_ns = self._clock() + self._limits.stop_ns

    def exchange(self, children: Iterable[Child]) -> None:
        """Exchanges the children for the given ones: new ones start, those that are not given end in order."""
        wanted = {child.component: child for child in children}
        for component in self.children.keys() - wanted.keys():
            self.renew(component)
            self._leaving.append(self.children[component])
        self.children = {component: self.children.get(component, child) for component, child in wanted.items()}

    def misconfigured(self) -> Child | None:
        """A child that its first start has ended with a user error, after which the rig should stop; None if none has.

        Later, in a rig that works, a file may be wrong that another configuration names, or that somebody has replaced.
        """
        failed = (child for child in self.children.values() if child.state is ChildState.FAILED and child.starts == 1)
        return next((child for child in failed if child.exit_code == Exit.USER), None)

    def exit_code(self) -> Exit | None:
        """The exit code with which the whole rig should end now; None as long as there is something to do.

        Without images or without any tracker there is nothing left to do; a recorder is not needed for that.
        """
        if self.misconfigured():
            return Exit.USER
        capture = [child for child in self.children.values() if child.component == "capture"]
        trackers = [child for child in self.children.values() if child.component.startswith("track/")]
        for group in (capture, trackers):
            if group and all(child.state is ChildState.FAILED for child in group):
                return Exit.FAILED
        finished = any(child.state is ChildState.FINISHED for child in capture)
        return Exit.OK if finished else None

    def stop(self, wait: Callable[[float], None]) -> None:
        """Stops all children: stage after stage, so that later stages still receive the last messages of earlier ones.

        Args:
            wait: passes the time given in seconds.
        """
        begin_ns = self._clock()
        stages = sorted({child.stage for child in self.children.values()})
        for number, stage in enumerate(stages):
            children = [child for child in self.children.values() if child.stage == stage]
            for child in children:
                if child.state is not ChildState.RENEWED:  # which has been signalled
                    child.process.terminate()
            # Equal time for each of the earlier stages; the last one, which drains to disk, has all that is left.
            share = (number + 1) / (len(stages) + 1) if number + 1 < len(stages) else 1.0
            deadline_ns = begin_ns + int(share * self._limits.stop_ns)
            while self._clock() < deadline_ns and any(child.process.poll() is None for child in children):
                wait(0.02)
            for child in children:
                self._finalize(child)
        for child in self._leaving:
            child.end()

    def _excuse_pause(self, now_ns: int) -> None:
        """Extends all deadlines by the time in which this process was stopped and received nothing."""
        paused_ns, self._polled_ns = now_ns - self._polled_ns, now_ns
        if paused_ns > PAUSE_NS:
            for child in self.children.values():
                child.deadline_ns += paused_ns
                child.overdue_ns += paused_ns
                child.limit_ns += paused_ns

    def _expect_health(self, child: Child, now_ns: int, busy: bool) -> None:
        child.received_ns, child.busy, child.limit_ns = now_ns, busy, now_ns + self._limits.startup_ns
        child.deadline_ns = child.limit_ns if busy else now_ns + self._limits.stall_ns
        child.overdue_ns = now_ns + (FIRST_POLL_NS if busy else OVERDUE_NS)

    def _start(self, child: Child, now_ns: int) -> None:
        child.end()
        try:
            child.process = self._spawn(child.component, child.arguments)
        except (OSError, EOFError, RuntimeError, MemoryError) as error:  # RuntimeError: too many threads
            self._start_later(child, now_ns, f"cannot be started: {error}")
            return
        started = {"component": child.component, "child": child.process.pid, "restarts": child.restarts}
        _log.info("%s is started", child.component, extra={"fields": started})
        child.lacks = child.awaits_correction  # whether its files are right by now, its health tells
        child.state, child.starts = ChildState.RUNNING, child.starts + 1
        child.reason = child.reason if child.lacks else ""
        child.started_ns, child.threads, child.looked_at = now_ns, {}, {}
        self._expect_health(child, now_ns, busy=True)

    def _check(self, child: Child, now_ns: int) -> None:
        code = child.process.poll()
        if code is None:
            if now_ns >= child.deadline_ns:
                self._treat_silence(child, now_ns)
            elif child.is_overdue(now_ns, self._limits.stall_ns):
                child.reason = f"no health for {(now_ns - child.received_ns) / 1e9:.0f} s"
            return
        child.exit_code, child.worst_code = code, max(child.worst_code, code)
        words = child.process.output_tail()
        if code == Exit.ENDED:
            child.state, child.process = ChildState.FINISHED, NO_PROCESS
        elif code == Exit.USER and child.starts == 1:
            self._give_up(child, now_ns, words)
        elif code == Exit.USER:  # a file that was right may be half-written, and will be put right
            child.restarts += 1
            self._start_later(child, now_ns, exit_reason(code, words))
        else:
            self._schedule_restart(child, now_ns, exit_reason(code, words), ChildState.BACKOFF)

    def _treat_silence(self, child: Child, now_ns: int) -> None:
        if now_ns < child.deadline_ns + min(child.waited_ns(now_ns), self._limits.startup_ns):
            silent_s = (now_ns - child.received_ns) / 1e9
            child.reason = f"no health for {silent_s:.0f} s, because it waits for a processor"
            return
        child.process.kill()
        self._schedule_restart(child, now_ns, "sent no health in time", ChildState.STALLED)

    def _schedule_restart(self, child: Child, now_ns: int, reason: str, state: ChildState) -> None:
        while child.exits_ns and child.exits_ns[0] <= now_ns - self._limits.window_ns:
            child.exits_ns.popleft()
        if len(child.exits_ns) >= self._limits.restarts:
            window = f"{self._limits.window_ns / 1e9:g} s"
            times = f"needed more than {self._limits.restarts} restarts in {window}, and is started again in {window}"
            self._give_up(child, now_ns, f"{times}; the last time it {reason}")
            return
        worked = now_ns - child.started_ns > WORKED_NS
        child.backoff_ns = FIRST_BACKOFF_NS // 2 if worked else min(2 * child.backoff_ns, MAX_BACKOFF_NS)
        child.start_at_ns = now_ns + (1 if worked else child.backoff_ns)  # 1: at the next look, when health has said it
        child.exits_ns.append(now_ns)
        child.restarts += 1
        child.state, child.reason, child.process = state, reason, NO_PROCESS
        self._tell(logging.WARNING, f"{child.component} {reason}; starting it again")

    def _start_later(self, child: Child, now_ns: int, reason: str) -> None:
        """Tries again, for ever, after what is no failure of the process: a lack of the host, or of a file of its."""
        child.lacks, child.start_at_ns = True, now_ns + MAX_BACKOFF_NS
        child.state, child.reason, child.process = ChildState.BACKOFF, reason, NO_PROCESS
        self._tell(logging.WARNING, f"{child.component} {reason}; trying again")

    def _give_up(self, child: Child, now_ns: int, reason: str) -> None:
        child.start_at_ns = now_ns + self._limits.window_ns
        child.state, child.reason, child.process = ChildState.FAILED, reason, NO_PROCESS
        if child is not self.misconfigured():  # whose message is the last word of the whole run
            self._tell(logging.ERROR, f"{child.component} is given up: {reason}")

    def _tell(self, level: int, text: str) -> None:
        """Logs a failure; one that comes again and again ever more rarely, since it may do so for months."""
        left_out = self._repeats.take(text, self._clock())
        if left_out is not None:
            _log.log(level, "%s", counted(text, left_out))

    def _finalize(self, child: Child) -> None:
        if child.process.poll() is None:
            child.reason = "did not end in time and was killed"
        if child.state in (ChildState.RUNNING, ChildState.BACKOFF, ChildState.STALLED, ChildState.RENEWED):
            child.state = ChildState.STOPPED
            child.end()
