import logging
import os
import subprocess
import sys
import types

import pytest

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from drivers.contract.device import DeviceError


@pytest.fixture
def command(monkeypatch):
    """A command `act` that does what the test says."""
    module = types.SimpleNamespace(
        __name__="abs_service.commands.act",
        __doc__="Acts.\n\nexamples:\n  abs-service act --times 3",
        add_arguments=lambda parser: parser.add_argument("--times", type=int, default=1),
    )
    monkeypatch.setitem(cli.COMMANDS, "act", "acts")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(logging, "basicConfig", lambda **_: None)

    def does(act):
        module.run = act
        return module

    return does


def raising(error):
    def act(arguments):
        raise error

    return act


def test_a_command_gets_its_arguments_and_gives_the_exit_code(command):
    command(lambda arguments: arguments.times)
    assert cli.main(["act", "--times", "7"]) == 7


def test_what_the_user_can_mend_is_one_message_and_exit_code_2(command, capsys):
    command(raising(DeviceError("no camera on this bus; plug one in")))
    assert cli.main(["act"]) == Exit.USER
    assert capsys.readouterr().err == "abs-service: error: no camera on this bus; plug one in\n"


def test_our_own_mistakes_keep_their_traceback(command):
    command(raising(ZeroDivisionError("division by zero")))
    with pytest.raises(ZeroDivisionError):
        cli.main(["act"])


def test_ctrl_c_before_the_command_handles_it(command):
    command(raising(KeyboardInterrupt()))
    assert cli.main(["act"]) == Exit.INTERRUPTED


def test_the_help_of_a_command_is_its_docstring(command, capsys):
    command(lambda arguments: 0)
    with pytest.raises(SystemExit):
        cli.main(["act", "--help"])
    out = capsys.readouterr().out
    assert "usage: abs-service act" in out
    assert "abs-service act --times 3" in out


def test_an_unknown_command_is_answered_with_the_closest(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["rnu"])
    assert caught.value.code == Exit.USER
    assert 'Did you mean "run"?' in capsys.readouterr().err


def test_without_a_command_the_help_is_shown(capsys):
    assert cli.main([]) == Exit.USER
    shown = capsys.readouterr().err
    assert all(name in shown for name in cli.COMMANDS)


@pytest.fixture
def group(command, monkeypatch):
    """A group `calls` with one command, the `act` of `command`."""
    act = command(lambda arguments: arguments.times)
    module = types.SimpleNamespace(
        __name__="abs_service.commands.calls", __doc__="Calls others.\n", COMMANDS={"act": "acts"}
    )
    monkeypatch.setitem(cli.COMMANDS, "calls", "calls")
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(sys.modules, "abs_service.commands.calls.act", act)


@pytest.mark.usefixtures("group")
class TestGroups:
    def test_a_command_of_a_group_gets_its_arguments(self):
        assert cli.main(["calls", "act", "--times", "7"]) == 7

    def test_the_help_of_a_group_lists_its_commands(self, capsys):
        assert cli.main(["calls"]) == Exit.USER
        shown = capsys.readouterr().err
        assert "Calls others." in shown
        assert "act  acts" in shown

    def test_an_unknown_command_of_a_group_is_answered_with_the_closest(self, capsys):
        with pytest.raises(SystemExit) as caught:
            cli.main(["calls", "cat"])
        assert caught.value.code == Exit.USER
        assert 'Did you mean "act"?' in capsys.readouterr().err

    def test_the_help_of_a_command_names_its_group(self, capsys):
        with pytest.raises(SystemExit):
            cli.main(["calls", "act", "--help"])
        assert "usage: abs-service calls act" in capsys.readouterr().out


def test_help_imports_no_command_and_nothing_heavy():
    code = (
        "import sys; from abs_service import cli\n"
        "try: cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'numba', 'zenoh', 'pydantic', 'rich', 'google'}\n"
        "print(heavy & sys.modules.keys(), file=sys.stderr)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    assert done.stderr.strip() == "set()"
    assert "examples:" in done.stdout


def test_a_command_computes_with_one_thread_unless_configured_otherwise():
    """So that as many trackers as a rig has get equal shares of the cores."""
    program = """
import contextlib, os, sys
from abs_service import cli
with contextlib.suppress(SystemExit):
    cli.main(["--version"])
import cv2, numpy, scipy.linalg
numpy.ones((500, 500)) @ numpy.ones((500, 500)), scipy.linalg.inv(numpy.eye(300))
cv2.GaussianBlur(numpy.zeros((1000, 1000), numpy.uint8), (0, 0), 3.0)
print(cv2.getNumThreads(), len(os.listdir("/proc/self/task")), os.environ["OMP_NUM_THREADS"])
"""
    free = {name: value for name, value in os.environ.items() if name not in cli.THREADS}
    free["PYTHONPATH"] = os.pathsep.join(sys.path)
    one, three = (
        subprocess.run([sys.executable, "-c", program], env=env, check=True, capture_output=True, text=True).stdout
        for env in (free, free | {"OMP_NUM_THREADS": "3"})
    )
    assert one.splitlines()[-1] == "1 1 1"
    assert three.splitlines()[-1].endswith(" 3")


def test_a_reader_that_goes_away_ends_the_command_quietly(tmp_path):
    (tmp_path / "talk.py").write_text(
        "import sys, types\nfrom abs_service import cli\n"
        "module = types.ModuleType('abs_service.commands.talk', 'Talks.')\n"
        "module.add_arguments = lambda parser: None\n"
        "module.run = lambda arguments: [print('x' * 1000, flush=True) for _ in range(100000)] and 0\n"
        "sys.modules[module.__name__] = module\ncli.COMMANDS['talk'] = 'talks'\n"
        "sys.exit(cli.main(['talk']))\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    talker = subprocess.Popen(
        [sys.executable, tmp_path / "talk.py"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    assert talker.stdout is not None
    talker.stdout.readline()
    talker.stdout.close()
    assert talker.stderr is not None
    assert talker.stderr.read() == b""
    talker.stderr.close()
    assert talker.wait(10) == Exit.PIPE_CLOSED


@pytest.mark.parametrize("command", ["run", "processes.capture", "processes.track", "processes.record"])
def test_a_process_of_a_rig_does_not_begin_with_imports_that_it_may_never_need(command):
    """`scipy.optimize` takes a quarter of a second, and as much again in each of the other processes."""
    heavy = ("numba", "scipy.optimize", "scipy.stats", "scipy.spatial")
    code = (
        f"import sys, abs_service.commands.{command}\nfrom abs_service import config\nconfig.load_default()\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert out.strip() == "[]"


@pytest.mark.parametrize("given", [["--bogus"], ["-q", "run"], ["calibrate", "--bogus"]])
def test_an_option_that_stands_before_a_command_and_is_none_is_named(given, capsys):
    with pytest.raises(SystemExit) as error:
        cli.main(given)
    assert error.value.code == Exit.USER
    assert "no such option before a command" in capsys.readouterr().err
