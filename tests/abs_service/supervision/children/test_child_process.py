import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from abs_service.supervision.children import forked
from abs_service.supervision.children.child_process import ChildProcess, ThreadTimes
from tests.abs_service.supervision.children import child_code
from tests.waiting import eventually

PATH = os.pathsep.join(sys.path)


@pytest.fixture
def child():
    """Starts Python code as a child; whatever is left is killed."""
    forked.preload("json")
    started = []

    def start(text, on_line=lambda component, line: None):
        started.append(ChildProcess("act", [text], on_line, child_code.run))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.output_tail()


def wait_for_end(process, seconds=10.0):
    deadline = time.monotonic() + seconds
    while process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process.poll()


def test_lines_of_both_outputs_arrive_with_the_name_of_the_component(child):
    lines = []
    process = child(
        "import sys; print('out'); print('err', file=sys.stderr); sys.exit(3)", lambda *line: lines.append(line)
    )
    assert wait_for_end(process) == 3
    assert process.output_tail() == "out\nerr"
    assert lines == [("act", "out"), ("act", "err")]


def test_a_child_ends_in_order_when_asked_and_asking_twice_is_harmless(child):
    ready = threading.Event()
    text = "import signal, sys\nsignal.signal(signal.SIGTERM, lambda *_: sys.exit(7))\nprint('ready')\nsignal.pause()"
    process = child(text, lambda *_: ready.set())
    assert ready.wait(10)
    process.terminate()
    assert wait_for_end(process) == 7
    process.terminate()
    process.kill()


def test_killing_a_child_kills_what_it_started(child):
    lines = []
    ready = threading.Event()
    text = (
        "import signal, subprocess, sys\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
        "print(subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)']).pid)\nsignal.pause()"
    )
    process = child(text, lambda _, line: (lines.append(line), ready.set()))
    assert ready.wait(10)
    process.kill()
    assert process.poll() == -signal.SIGKILL
    assert gone(int(lines[0]))


SUPERVISOR = """
import sys, time
from abs_service.supervision.children.child_process import ChildProcess
from tests.abs_service.supervision.children import child_code
text = '''
import signal, time
from abs_service.supervision.children import parent_watchdog
parent_watchdog.GRACE_S = 0.2
signal.signal(signal.SIGTERM, {handler})
parent_watchdog.start()
print("ready", flush=True)
while True:
    time.sleep(60)
'''
child = ChildProcess("act", [text], lambda *_: print(child.pid, flush=True), child_code.run)
time.sleep(60)
"""


@pytest.mark.parametrize("handler", ["signal.SIG_DFL", "signal.SIG_IGN"])
def test_no_child_outlives_a_supervisor_that_was_killed(handler):
    supervisor = subprocess.Popen(
        [sys.executable, "-c", SUPERVISOR.format(handler=handler)],
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": PATH},
    )
    assert supervisor.stdout is not None
    with supervisor.stdout as output:
        pid = int(output.readline())
        supervisor.kill()
        supervisor.wait()
    assert gone(pid)


FORKED = """
import os, shutil, signal
from multiprocessing import util
from abs_service.supervision.children import forked
from abs_service.supervision.children.child_process import ChildProcess
from tests.abs_service.supervision.children import child_code
from tests.waiting import eventually

def servers():
    listed = open(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read().split()
    return {int(pid) for pid in listed if b"forkserver" in open(f"/proc/{pid}/cmdline", "rb").read()}

forked.preload("json")
text = "import os, sys; os.read(0, 1); sys.exit(7)"
before = ChildProcess("act", [text], print, child_code.run)
(first,) = servers()
os.kill(first, signal.SIGKILL)
assert eventually(lambda: not servers())
assert before.poll() is None
assert eventually(lambda: forked.ensure_running() or servers())  # a process that is ending is not yet waited for
after = ChildProcess("act", ["print('works')"], lambda *_: None, child_code.run)
assert after.output_tail() == "works"
os.kill(*servers(), signal.SIGSTOP)
forked.ensure_running()
assert ChildProcess("act", ["print('goes on')"], lambda *_: None, child_code.run).output_tail() == "goes on"
before.wake()
before.output_tail()
print(before.poll(), after.poll(), flush=True)

os.chdir(os.mkdir(path := util.get_temp_dir() + "/work") or path)
shutil.rmtree(util.get_temp_dir())
(deaf,) = servers()
assert eventually(lambda: forked.ensure_running() or not servers() & {deaf} and os.listdir(util.get_temp_dir()))
print(ChildProcess("act", ["print('works again')"], lambda *_: None, child_code.run).output_tail(), flush=True)
"""


def test_children_outlive_the_fork_server():
    done = subprocess.run(
        [sys.executable, "-c", FORKED],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env=os.environ | {"PYTHONPATH": PATH},
    )
    assert done.stdout == "7 0\nworks again\n", done.stderr


WOKEN = """
from abs_service.supervision.children import parent_watchdog
woken = parent_watchdog.start()
for number in range(2):
    print(woken.is_set(), flush=True)
    print(woken.wait(10), flush=True)
    woken.clear()
"""


def test_a_child_that_is_woken_sees_it_each_time(child):
    lines = []
    process = child(WOKEN, lambda _, line: lines.append(line))
    for waits in (["False"], ["False", "True", "False"]):
        assert eventually(lambda waits=waits: lines == waits)
        process.wake()
    assert wait_for_end(process) == 0
    assert process.output_tail() == "False\nTrue\nFalse\nTrue"


PRELOADING = """
import time
from abs_service.supervision.children import forked
from abs_service.supervision.children.child_process import ChildProcess
from tests.abs_service.supervision.children import child_code

forked.preload("abs_service.commands.processes.preloaded")
child = ChildProcess("act", ["print('works')"], lambda _, line: print(line, flush=True), child_code.run)
time.sleep(60)
"""


@pytest.fixture
def short_folder():
    """A temporary folder whose name is short enough for a socket in it, as those of tests are not always."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def test_a_killed_supervisor_leaves_nothing_in_the_temporary_folder(short_folder):
    environment = os.environ | {"PYTHONPATH": PATH, "TMPDIR": str(short_folder)}
    command = [sys.executable, "-c", PRELOADING]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as supervisor:
        assert supervisor.stdout is not None
        assert supervisor.stdout.readline() == "works\n"
        assert list(short_folder.iterdir())
        supervisor.kill()
    assert eventually(lambda: not list(short_folder.iterdir()))


def test_a_child_is_known_by_its_command_line(child):
    ready = threading.Event()
    process = child("import os; print('ready'); os.read(0, 1)", lambda *_: ready.set())
    assert ready.wait(10)
    with open(f"/proc/{process.pid}/cmdline") as cmdline:
        assert cmdline.read().rstrip("\0") == "abs-service import os; print('ready'); os.read(0, 1)"


def gone(pid, seconds=5.0):
    """True if a process that is not our child ends within the time."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        try:
            with open(f"/proc/{pid}/stat") as stat:
                if stat.read().rpartition(")")[2].split()[0] == "Z":
                    return True
        except OSError:
            return True
        time.sleep(0.02)
    return False


def test_the_time_that_a_child_waits_for_a_processor_is_known(child):
    busy = "import os\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nwhile True: pass"
    both = [child(busy), child(busy)]

    def compete(process):
        times = process.threads().get(process.pid, ThreadTimes())
        return min(times.ran_ns, times.waited_ns) > 100_000_000 and times.runnable

    assert eventually(lambda: all(map(compete, both)))
    both[0].kill()
    assert both[0].threads() == {}
