"""User errors are one message, with exit code 2 and without a traceback."""

import socket

import pytest

from abs_service.cli import main
from abs_service.supervision.exit_codes import Exit


@pytest.fixture
def refused(capfd):
    """The message of a command that is refused."""

    def refused(*arguments):
        assert main([str(one) for one in arguments]) == Exit.USER
        error = capfd.readouterr().err
        assert error.count("error: ") == 1
        return error.partition("error: ")[2]

    return refused


@pytest.mark.parametrize("command", ["run", "check", "capture", "track", "record"])
def test_a_file_that_is_not_there(refused, command, tmp_path):
    assert refused(command, tmp_path / "no.toml") == f"{tmp_path}/no.toml: cannot be read: No such file or directory\n"


def test_a_file_that_is_no_toml(refused, rig_file):
    rig_file.write_text("version = \n")
    message = refused("run", rig_file)
    assert message.startswith(f"{rig_file}: not TOML: ")
    assert "line 1" in message


def test_a_port_in_use(refused, rig_file, endpoint):
    with socket.create_server(("127.0.0.1", int(endpoint.rpartition(":")[2]))):
        message = refused("run", rig_file)
    assert message.startswith(f'bus.endpoint = "{endpoint}": the address is in use')


def test_a_folder_that_cannot_be_written(refused, rig_file, tmp_path):
    (tmp_path / "taken").write_text("a file")
    message = refused("run", rig_file, "--out", tmp_path / "taken" / "below")
    assert f'"{tmp_path}/taken/below": cannot be made' in message


def test_a_folder_that_takes_no_files(refused, rig_file):
    # Not even from root, for whom permissions are no obstacle.
    assert refused("run", rig_file, "--out", "/proc").startswith('record.directory = "/proc": cannot be written: ')


@pytest.mark.parametrize("name", ["a/b", "", "*", "a b$"])
def test_a_name_that_cannot_be_on_the_wire(refused, name, rig_file):
    assert repr(name) in refused("run", rig_file, "--rig", name).replace('"', "'")


def test_a_device_address_that_no_device_can_have(refused, rig_file):
    rig_file.write_text(rig_file.read_text().replace("simulated://sheet?seed=1", "simulated://sheet?sed=1"))
    message = refused("run", rig_file)
    assert message.startswith(f"{rig_file}: devices.sim.uri = \"simulated://sheet?sed=1\": unknown key 'sed'")


def test_all_device_addresses_that_no_device_can_have(refused, rig_file):
    text = rig_file.read_text().replace("simulated://sheet?seed=1", "simulated://sheet?sed=1")
    rig_file.write_text(text + '[devices.second]\nuri = "kinect1://?stream=ir"\n')
    message = refused("run", rig_file)
    assert message.startswith(f"{rig_file}: 2 errors\n")
    assert "unknown key 'sed'" in message
    assert "devices.second.uri = \"kinect1://?stream=ir\": unknown key 'stream'" in message


@pytest.mark.parametrize(
    ("command", "option", "file"),
    [
        ("rig x.mcap --target board.toml", "--out", "x.toml"),
        ("intrinsics x.mcap --target board.toml --out x.toml", "--corners", "x.vnl"),
        ("noise x.mcap --distance-m 1", "--out", "x"),
        ("verify x.toml x.mcap --target board.toml", "--report", "x.html"),
        ("capture RIG --target board.toml", "--out", "x.mcap"),
    ],
)
def test_a_folder_that_is_not_there_is_named_before_the_work(refused, rig_file, tmp_path, command, option, file):
    (tmp_path / "board.toml").write_text('kind = "chessboard"\ncolumns = 9\nrows = 6\nsquare_mm = 25.0\n')
    words = command.replace("RIG", str(rig_file)).replace("board.toml", str(tmp_path / "board.toml")).split()
    out = tmp_path / "no" / file
    assert refused("calibrate", *words, option, out) == f"{option} {out}: there is no folder {tmp_path}/no\n"


class TestReplay:
    def test_of_nothing(self, refused, tmp_path):
        assert refused("replay", tmp_path / "no.mcap") == f"{tmp_path}/no.mcap: No such file or directory\n"

    def test_of_something_else(self, refused, rig_file):
        assert refused("replay", rig_file).startswith(f"{rig_file}: this is no MCAP file")
