"""The commands of docs/how-to/mutual-tls.md work as they stand there, with both hosts on this one."""

import json
import re
import shlex
import signal
from pathlib import Path

import pytest

from tests.conftest import encrypted
from tests.system.running import START_S, write_rig
from tests.waiting import eventually

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "mutual-tls.md").read_text("utf-8")


@pytest.fixture
def commands(endpoint):
    """Words of each command of the page, after `abs-service` or the interpreter."""
    text = PAGE.replace("tls/rig.lab:7447", encrypted(endpoint)).replace("rig.lab", "localhost")
    lines = "".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL)).splitlines()
    return [shlex.split(line)[1:] for line in lines]


def write(path, endpoint, name):
    rig = write_rig(path, encrypted(endpoint))
    (table,) = re.findall(r"\[bus\.tls\]\n(.*?)```", PAGE, re.DOTALL)
    rig.write_text(rig.read_text("utf-8") + "\n[bus.tls]\n" + table.replace("keys/rig.", f"keys/{name}."), "utf-8")


def test_two_hosts_a_reader_and_an_operator(commands, endpoint, launch, tmp_path):
    make, check_rig, check_tracker, capture, track, subscribe, reinitialize = commands
    for file, name in (("rig", "rig"), ("tracker", "tracker"), ("operator", "operator"), ("reader", "viewer")):
        write(tmp_path / f"{file}.toml", endpoint, name)
    for command in (make, check_rig, check_tracker):
        assert launch(*command, cwd=tmp_path).wait(START_S) == 0
    log, tracked = tmp_path / "rig.log", tmp_path / "tracker.log"
    rig = launch(*capture, "--log-file", log, "--log-level", "info", cwd=tmp_path)
    assert eventually(lambda: log.exists() and "abs-service capture" in log.read_text("utf-8"), START_S)
    assert launch(*track[:1], "reader.toml", cwd=tmp_path).wait(START_S) == 2  # a viewer is no tracker
    tracker = launch(*track, "--log-file", tracked, cwd=tmp_path)
    assert eventually(lambda: "tracker connected: " in log.read_text("utf-8"), START_S)
    subscribe[0] = str(ROOT / subscribe[0])
    reader = launch(*subscribe, cwd=tmp_path, program=(), stdout=-1)
    lines, errors = reader.communicate(timeout=START_S)
    assert (reader.returncode, len(lines.splitlines())) == (0, 5), errors
    assert launch(*reinitialize, cwd=tmp_path).wait(START_S) == 0
    assert re.search(r"command 1: sheet/reinitialize from process \w+ on \S+: accepted", tracked.read_text("utf-8"))
    subscribe[-1] = f"{encrypted(endpoint)}#root_ca_certificate_file=keys/authority.pem"
    assert launch(*subscribe, cwd=tmp_path, program=(), stdout=-1).wait(START_S) == 1
    assert eventually(lambda: "refused: peer sent no certificates" in log.read_text("utf-8"))
    for process in (tracker, rig):
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
    assert {"operator connected", "viewer connected"} <= set(re.findall(r"\w+ connected", log.read_text("utf-8")))


def test_run_keeps_its_output_clean_and_logs_whom_it_refuses(keys, endpoint, launch, tmp_path):
    write(tmp_path / "rig.toml", endpoint, "rig")
    (tmp_path / "keys").symlink_to(keys)
    output, log = tmp_path / "output.jsonl", tmp_path / "run.log"
    with output.open("w", encoding="utf-8") as stream:
        process = launch("run", tmp_path / "rig.toml", "--json", "--log-file", log, stdout=stream)
        assert eventually(lambda: '"TRACKING"' in output.read_text("utf-8"), START_S)
        no_certificate = f"{encrypted(endpoint)}#root_ca_certificate_file={keys / 'authority.pem'}"
        reader = launch(ROOT / "examples" / "subscribe.py", "--endpoint", no_certificate, program=(), stdout=-1)
        assert reader.wait(START_S) == 1
        assert eventually(lambda: "a client was refused: peer sent no certificates" in log.read_text("utf-8"))
        process.send_signal(signal.SIGTERM)
        assert process.wait(15) == 0
    assert all(json.loads(line) for line in output.read_text("utf-8").splitlines())
    assert len(list((tmp_path / "takes").glob("*.mcap"))) == 1
