"""`abs-ros2` from the command line."""

import os
import signal
import subprocess
import sys

import pytest
from abs_client.ros2 import program

from tests.waiting import eventually

TIMEOUT_S = 30.0


def started(*arguments, environment=None):
    command = [sys.executable, "-m", "abs_client.ros2", *arguments]
    variables = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | (environment or {})
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=variables)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_publishes_until_it_is_told_to_end(bus, endpoint, ros_router, number):
    router, session = ros_router
    with started("--endpoint", endpoint, "--router", router, environment={"ROS_DOMAIN_ID": "7"}) as process:
        assert next(iter(process.stdout or ())) == f"rig demo at {endpoint}: to ROS domain 7 at {router}\n"
        tokens = []  # the router may know of the node a moment after the program says that it publishes

        def announced():
            tokens[:] = [str(one.ok.key_expr) for one in session.liveliness().get("@ros2_lv/**") if one.ok]
            return tokens

        assert eventually(announced)
        process.send_signal(number)
        output, errors = process.communicate(timeout=TIMEOUT_S)
    assert (process.returncode, output, errors) == (0, "", "")
    (token,) = tokens
    assert token.endswith("/0/0/NN/%/%/abs_demo")
    assert token.startswith("@ros2_lv/7/")


def test_a_rig_that_is_not_there_is_told(endpoint, ros_router, capsys):
    assert program.main(["--endpoint", endpoint, "--router", ros_router[0]]) == 2
    assert capsys.readouterr().err == f"nothing answers at {endpoint} within 3 s: is it running?\n"


@pytest.mark.parametrize("domain", ["233", "-1", "one"])
def test_a_domain_that_cannot_be_is_refused(domain, capsys):
    with pytest.raises(SystemExit, match="2"):
        program.main(["--router", "tcp/127.0.0.1:7447", f"--domain={domain}"])
    assert f"'{domain}' is no ROS domain: a number from 0 to 232" in capsys.readouterr().err


def test_a_missing_extra_is_named(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "xxhash", None)
    monkeypatch.delitem(sys.modules, "abs_client.ros2.layout", raising=False)
    monkeypatch.delattr("abs_client.ros2.layout", raising=False)
    assert program.main(["--router", "tcp/127.0.0.1:7447"]) == 2
    assert "pip install './client[ros2]'" in capsys.readouterr().err
