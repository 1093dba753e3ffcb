"""`abs-service new` writes rig files that `check` accepts, from options or answers."""

import itertools
import os
import pty
import subprocess
import sys
import tomllib

import pytest

from abs_service import cli
from abs_service.commands.new import new
from abs_service.commands.new.rig_text import BEHIND, DEVICES, OBJECTS
from abs_service.supervision.exit_codes import Exit
from drivers.contract.device import DeviceInfo
from drivers.contract.discovery import Found


def options(device="simulated", thing="sheet", color=True, behind="space"):
    size = ["--size", "0.297", "0.21"] if thing == "known-sheet" else []
    colored = "--color" if color else "--no-color"
    return ["--device", device, "--object", thing, *size, colored, "--behind", behind]


@pytest.mark.parametrize(
    ("device", "thing", "color", "behind"), list(itertools.product(DEVICES, OBJECTS, (True, False), BEHIND))
)
def test_every_combination_of_answers_is_a_rig_that_check_accepts(device, thing, color, behind, tmp_path, capsys):
    rig = tmp_path / "lab.toml"
    assert cli.main(["new", str(rig), *options(device, thing, color, behind)]) == Exit.OK
    assert cli.main(["check", str(rig)]) == Exit.OK, capsys.readouterr().err
    shown = capsys.readouterr().out
    assert 'describes rig "lab"' in shown
    assert ("sensor   color" in shown) == color
    text = rig.read_text()
    assert max(map(len, text.splitlines())) < 160
    assert all(
        line.startswith(("#", "[")) or not line or "=" in line for line in text.splitlines()
    )  # nothing is left of a template


def test_the_comments_name_the_answers_and_the_next_commands(tmp_path, capsys):
    rig = tmp_path / "lab.toml"
    cli.main(["new", str(rig), *options(thing="body", behind="plane")])
    text = rig.read_text()
    assert text.startswith("# A soft body that bends and stretches.\n# Camera: the simulated camera")
    assert f"abs-service run {rig}" in text
    assert f"abs-service check {rig}" in capsys.readouterr().out


def test_the_size_and_the_address_are_those_that_were_given(tmp_path):
    rig = tmp_path / "lab.toml"
    given = options("oak-tof", "known-sheet")
    cli.main(["new", str(rig), *given, "--uri", "oak://18443010E1A2B3C4?mode=tof", "--name", "bench"])
    table = tomllib.loads(rig.read_text())
    assert table["name"] == "bench"
    assert table["devices"]["camera"]["uri"] == "oak://18443010E1A2B3C4?mode=tof"
    assert table["trackers"]["object"]["model"] == {"type": "flexpad", "width_m": 0.297, "height_m": 0.21}


def test_a_file_that_exists_is_replaced_only_by_force(tmp_path, capsys):
    rig = tmp_path / "lab.toml"
    rig.write_text("mine")
    assert cli.main(["new", str(rig), *options()]) == Exit.USER
    assert rig.read_text() == "mine"
    assert "--force" in capsys.readouterr().err
    assert cli.main(["new", str(rig), *options(), "--force"]) == Exit.OK
    assert "version = 1" in rig.read_text()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (["--uri", "kinect1://"], "begins with simulated://"),
        (["--uri", "simulated://sheet?sede=1"], "unknown key 'sede'"),
        (["--object", "known-sheet", "--size", "100", "1"], "--size 100 1: sides are lengths"),
        (["--object", "known-sheet", "--size", "297", "210"], "less than 100; did you mean 0.297 0.21?"),
        (["--name", "a/b"], "is no name"),
    ],
)
def test_answers_that_are_impossible_are_refused_and_leave_no_file(tmp_path, capsys, wrong, said):
    rig = tmp_path / "lab.toml"
    assert cli.main(["new", str(rig), *options(), *wrong]) == Exit.USER
    assert said in capsys.readouterr().err
    assert not rig.exists()


def without(option):
    given = options(thing="known-sheet")
    place = given.index(option)
    return given[:place] + given[place + {"--color": 1, "--size": 3}.get(option, 2) :]


@pytest.mark.parametrize("option", ["--device", "--object", "--size", "--color", "--behind"])
def test_a_script_is_told_which_answer_is_missing(tmp_path, capsys, option):
    assert cli.main(["new", str(tmp_path / "lab.toml"), *without(option)]) == Exit.USER
    said = capsys.readouterr().err.splitlines()
    assert said[0].endswith("error: options are missing, and nobody is there to be asked:")
    assert [line.split(":")[0].strip() for line in said[1:]] == [option]


def test_a_script_is_told_all_missing_answers_at_once(tmp_path, capsys):
    assert cli.main(["new", str(tmp_path / "lab.toml")]) == Exit.USER
    said = capsys.readouterr().err.splitlines()[1:]
    assert [line.split(":")[0].strip() for line in said] == ["--device", "--object", "--color", "--behind"]
    assert not list(tmp_path.iterdir())


def test_attached_cameras_are_offered_by_their_addresses():
    kinect = Found(DeviceInfo("kinect1://A00363A01234040A", "Kinect v1", "A00363A01234040A"))
    oak = Found(DeviceInfo("oak://1844", "OAK-D-SR-PoE ToF", "1844"))
    orbbec = Found(DeviceInfo("orbbec://CL8", "Orbbec Femto Bolt", "CL8"))
    nothing = Found(DeviceInfo("oak://", "OAK", ""))
    offered = {}

    def ask(option, question, choices):
        offered[option] = list(choices)
        return {"device": "oak://1844", "object": "rigid", "color": "no", "behind": "space"}[option]

    arguments = cli.command_parser("new", new).parse_args(["x.toml"])
    answers = new.answered(arguments, "x", [kinect, oak, orbbec, nothing], ask)
    assert offered["device"] == [*("kinect1://A00363A01234040A", "oak://1844", "orbbec://CL8"), *DEVICES, "recording"]
    assert new.device_of(orbbec) == "orbbec-tof"
    assert (answers.device, answers.uri, answers.color) == (DEVICES["oak-tof"], "oak://1844", False)


def test_a_person_is_asked(tmp_path):
    rig = tmp_path / "lab.toml"
    here, there = pty.openpty()
    command = [sys.executable, "-m", "abs_service", "new", str(rig), "--device", "simulated"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdin=there, stdout=there, env=environment) as process:
        os.write(here, b"7\n1\n0.3 0.2\nno\n2\n")
        assert process.wait(30) == 0
    shown = os.read(here, 10_000).decode()
    assert "What is the object?" in shown
    table = tomllib.loads(rig.read_text())
    assert table["trackers"]["object"]["model"]["width_m"] == 0.3
    assert table["trackers"]["object"]["region"]["type"] == "above_plane"


def test_an_end_of_the_input_is_told_and_leaves_no_file(tmp_path, monkeypatch, capsys):
    lines = iter(["one"])

    def answer(prompt):
        try:
            return next(lines)
        except StopIteration:
            raise EOFError from None

    monkeypatch.setattr("builtins.input", answer)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    given = ["--device", "simulated", "--object", "sheet", "--color"]
    assert cli.main(["new", str(tmp_path / "lab.toml"), *given]) == Exit.USER
    said = capsys.readouterr()
    assert "a number from 1 to 3 or one of space, plane, things, please" in said.out
    assert "the input ended before --behind was answered" in said.err
    assert list(tmp_path.iterdir()) == []


def test_a_device_that_no_file_is_written_for_is_told_the_way(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["new", str(tmp_path / "rig.toml"), "--device", "zed"])
    assert ended.value.code == Exit.USER
    message = capsys.readouterr().err
    assert "'zed': no such device, allowed: " in message
    assert "copy examples/rigs/o3r.toml or genicam.toml; others: `abs-service import` their images" in message
