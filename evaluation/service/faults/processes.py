"""Faults of processes: killed, stopped, hanging, asked to end."""

import math
import signal
import time
from collections.abc import Callable
from functools import partial

from evaluation.service.faults.fault import Fault, Made
from evaluation.service.faults.running import STALL_S, RunningRig
from evaluation.service.live.proc import is_running

#: For how long a process is stopped [s]: less than the bus's lease, more than a disk or a debugger takes.
STOP_S = 1.5
#: The same, as processes start: longer than they try to connect [s].
UNANSWERED_S = 5.0
#: Time in which all processes of a rig end [s].
END_S = 5.0
#: Time in which a rig that is started, or has its cameras again, tracks [s].
TRACKS_S = 3.0


def killed(component: str, rig: RunningRig) -> Made:
    """`kill -9` of a process."""
    begin_ns = rig.signal(component, signal.SIGKILL)
    return Made(begin_ns, begin_ns)


def asked(component: str, rig: RunningRig) -> Made:
    """SIGTERM to a process of `run`, of which `run` knows nothing."""
    process = rig.processes()[component]
    begin_ns = rig.signal(component, signal.SIGTERM)
    return Made(begin_ns, _await_end(process, rig, begin_ns, END_S))


def _await_end(process: int, rig: RunningRig, begin_ns: int, maximum_s: float) -> int:
    while is_running(process) and rig.now_ns() < begin_ns + maximum_s * 1e9:
        time.sleep(0.01)
    return rig.now_ns()


def run_killed(rig: RunningRig) -> Made:
    """`kill -9` of `run`, which is started again when its processes have ended."""
    processes = rig.processes().values()
    begin_ns = rig.signal("run", signal.SIGKILL)
    return _started_again(rig, begin_ns, lambda: any(map(is_running, processes)), "")


def terminated(rig: RunningRig) -> Made:
    """SIGTERM to `run`, which is started again afterwards."""
    processes = rig.processes().values()
    begin_ns = rig.now_ns()
    code = rig.service.stop(END_S, signal.SIGTERM)
    left = [path.name for path in rig.takes.glob("*.active")]
    broken = ", ".join([*([f"exit code {code}"] if code else []), *(f"{name} is not complete" for name in left)])
    return _started_again(rig, begin_ns, lambda: any(map(is_running, processes)), broken)


def _started_again(rig: RunningRig, begin_ns: int, alive: Callable[[], bool], broken: str) -> Made:
    while alive() and rig.now_ns() < begin_ns + 3 * END_S * 1e9:
        time.sleep(0.01)
    took_s = (rig.now_ns() - begin_ns) * 1e-9
    late = f"processes ended after {took_s:.1f} s" if took_s > END_S else ""
    return Made(begin_ns, rig.start_again(), ", ".join(filter(None, [broken, late])))


def stopped(component: str, rig: RunningRig) -> Made:
    """SIGSTOP, and SIGCONT after `STOP_S`."""
    begin_ns = rig.signal(component, signal.SIGSTOP)
    time.sleep(STOP_S)
    return Made(begin_ns, rig.signal(component, signal.SIGCONT))


def stopped_at_start(rig: RunningRig) -> Made:
    """SIGSTOP to `run` as its processes start, which cannot connect meanwhile, and SIGCONT."""
    rig.service.stop(END_S, signal.SIGTERM)
    begin_ns = rig.start_again()
    while "capture" not in rig.processes():
        rig.service.check()
        time.sleep(0.01)
    rig.signal("run", signal.SIGSTOP)
    time.sleep(UNANSWERED_S)
    return Made(begin_ns, rig.signal("run", signal.SIGCONT))


def hangs(component: str, rig: RunningRig) -> Made:
    """SIGSTOP for good: the process has to be killed and started again."""
    hanging = rig.processes()[component]
    begin_ns = rig.signal(component, signal.SIGSTOP)
    return Made(begin_ns, _await_end(hanging, rig, begin_ns, 3 * STALL_S))


_BACK = "restarted; the others go on"
_HANGS = f"hangs (`run.stall_timeout_s = {STALL_S:g}`)"
_CAPTURE, _TRACK, _RECORD = (frozenset({name}) for name in ("capture", "track", "record"))
_ALL = frozenset({"run", "fork-server", *_CAPTURE, *_TRACK, *_RECORD})
#: `run` itself is gone, which says so.
_UNSAID = math.inf

FAULTS = (
    Fault("kill -9 of `capture`", _BACK, partial(killed, "capture"), 3.0, 3.0, restarted=_CAPTURE),
    Fault("kill -9 of `track`", _BACK, partial(killed, "track"), 3.0, restarted=_TRACK),
    Fault(
        "kill -9 of `record`", "nothing older than 1 s is lost", partial(killed, "record"), 0.5, 1.5, restarted=_RECORD
    ),
    Fault("SIGTERM of `capture`", _BACK, partial(asked, "capture"), 3.0, 3.0, restarted=_CAPTURE),
    Fault("SIGTERM of `track`", _BACK, partial(asked, "track"), 3.0, restarted=_TRACK),
    Fault("SIGTERM of `record`", _BACK, partial(asked, "record"), 0.5, 1.5, restarted=_RECORD),
    Fault(
        "kill -9 of the fork server",
        "nothing is lost; another one is ready",
        partial(killed, "fork-server"),
        noticed_s=_UNSAID,
        restarted=frozenset({"fork-server"}),
    ),
    Fault(
        "kill -9 of `run`, started again",
        f"its processes end within {END_S:g} s; then it tracks within {TRACKS_S:g} s",
        run_killed,
        math.inf,
        math.inf,
        _UNSAID,
        TRACKS_S,
        _ALL,
    ),
    Fault(
        "SIGTERM of `run`, started again",
        f"exit code 0 and complete files within {END_S:g} s; then it tracks within {TRACKS_S:g} s",
        terminated,
        math.inf,
        math.inf,
        _UNSAID,
        TRACKS_S,
        _ALL,
    ),
    Fault(f"SIGSTOP of `capture` for {STOP_S:g} s", "goes on", partial(stopped, "capture"), 2.5, 2.5),
    Fault(f"SIGSTOP of `track` for {STOP_S:g} s", "goes on", partial(stopped, "track"), 2.5),
    Fault(f"SIGSTOP of `record` for {STOP_S:g} s", "nothing is lost", partial(stopped, "record"), noticed_s=math.inf),
    Fault(f"SIGSTOP of `run` for {STOP_S:g} s", "nobody is killed", partial(stopped, "run"), 2.5, 2.5, _UNSAID),
    Fault(
        f"SIGSTOP of `run` for {UNANSWERED_S:g} s as its processes start",
        f"they are started again; then it tracks within {UNANSWERED_S:g} s",
        stopped_at_start,
        math.inf,
        math.inf,
        _UNSAID,
        UNANSWERED_S,
        _ALL,
    ),
    Fault(f"`capture` {_HANGS}", _BACK, partial(hangs, "capture"), STALL_S + 4, STALL_S + 4, restarted=_CAPTURE),
    Fault(f"`track` {_HANGS}", _BACK, partial(hangs, "track"), STALL_S + 4, restarted=_TRACK),
    Fault(f"`record` {_HANGS}", _BACK, partial(hangs, "record"), 0.5, STALL_S + 2.5, restarted=_RECORD),
)
