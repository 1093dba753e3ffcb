"""A disk that stands still: nothing ends who writes to it, and so waits in the kernel. Needs root and a loop device."""

import signal
import subprocess
import time
from contextlib import ExitStack

import pytest

from evaluation.experiment import UnavailableError
from evaluation.service.faults.running import disk
from evaluation.service.live.proc import children
from tests.system.running import START_S, RigListener, abs_service, kill, wait_until, write_rig

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


@pytest.fixture
def freeze(tmp_path):
    """Lets the disk at `takes` stand still, or go on."""
    takes = tmp_path / "takes"

    def freeze(frozen):
        subprocess.run(["fsfreeze", "--freeze" if frozen else "--unfreeze", takes], check=True, timeout=60)

    with ExitStack() as stack:
        try:
            stack.enter_context(disk(takes, 300))
        except UnavailableError as error:
            pytest.skip(f"no disk in a file can be mounted: {error}")
        yield freeze


@pytest.fixture
def rig_file(tmp_path, endpoint, freeze):
    """The demo rig, whose folder of recordings has that disk."""
    return write_rig(tmp_path / "rig.toml", endpoint)


def test_a_rig_reads_its_file_again_goes_on_and_ends_in_time(run, rig_file, freeze):
    process, listener = run
    freeze(True)
    try:
        said = wait_until(lambda: [one for one in listener.health("record") if one.level > 1], 10, "health of record")
        assert "the disk has not answered for 2 s" in said[0].message
        assert abs_service("reload", rig_file).stdout == "nothing has changed\n"
        wait_until(listener.tracks_since(time.monotonic_ns()), 20, "TRACKING")
        process.send_signal(signal.SIGTERM)
        assert process.wait(15) == 1
    finally:
        freeze(False)  # here, since what is left behind keeps the output open


def test_a_log_on_it_keeps_nobody_from_working(rig_file, endpoint, launch, freeze, tmp_path):
    log = ("--log-level", "info", "--log-file", tmp_path / "takes" / "log")
    process = launch("run", rig_file, "--no-record", "--json", *log, stdout=subprocess.DEVNULL, process_group=0)
    with RigListener(endpoint) as listener:
        wait_until(listener.tracks_since(0), START_S, "TRACKING")
        freeze(True)
        try:
            killed_ns = kill(children(process.pid)["track"])  # of which `run` writes a line
            wait_until(listener.tracks_since(killed_ns), 20, "TRACKING of the next process")
        finally:
            freeze(False)
        process.send_signal(signal.SIGTERM)
        assert process.wait(15) == 0
    assert "track/sheet ended by signal 9" in (tmp_path / "takes" / "log").read_text("utf-8")
