import signal

from abs_service.supervision.children import forked


def test_ctrl_c_does_not_reach_a_fork_server_that_begins(monkeypatch):
    def blocked():
        return signal.pthread_sigmask(signal.SIG_BLOCK, ())

    masks = []
    monkeypatch.setattr(forked.forkserver, "ensure_running", lambda: masks.append(blocked()))
    forked.preload("json")
    assert (masks, blocked()) == ([{signal.SIGINT}], set())
