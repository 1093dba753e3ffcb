import signal
import subprocess
import sys
from pathlib import Path

import pytest

from abs_service.supervision.children import forked
from abs_service.supervision.children.child_process import ChildProcess


def test_ctrl_c_does_not_reach_a_fork_server_that_begins(monkeypatch):
    def blocked():
        return signal.pthread_sigmask(signal.SIG_BLOCK, ())

    masks = []
    monkeypatch.setattr(forked.forkserver, "ensure_running", lambda: masks.append(blocked()))
    forked.preload("json")
    assert (masks, blocked()) == ([{signal.SIGINT}], set())


def test_processes_of_run_end_before_it_for_want_of_memory():
    """All are about equally large: the kernel ended `run`, and with it the rig."""
    mine = int(Path("/proc/self/oom_score_adj").read_text(encoding="ascii"))
    code = f"from {forked.__name__} import give_way; give_way(); print(open('/proc/self/oom_score_adj').read())"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(said.stdout) == min(mine + forked.OOM_SCORE, 1000)


@pytest.mark.parametrize("lost", [EOFError("unexpected EOF"), ConnectionRefusedError(111, "Connection refused")])
def test_a_fork_server_that_is_killed_as_it_forks_is_said_in_words(monkeypatch, lost):
    def fail(process):
        raise lost

    monkeypatch.setattr(forked.CONTEXT.Process, "start", fail)
    with pytest.raises(OSError, match="the fork server has ended: somebody has killed it"):
        ChildProcess("act", [], lambda component, line: None)
