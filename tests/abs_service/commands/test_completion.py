"""The script for bash is run by bash; those for other shells are made from the same table."""

import subprocess

import pytest

from abs_service import cli
from abs_service.commands import completion
from abs_service.supervision.exit_codes import Exit


@pytest.fixture(scope="module")
def commands():
    return list(completion.found("", cli.COMMANDS, cli.MODULES, "abs_service.commands"))


@pytest.fixture(scope="module")
def completed(commands, tmp_path_factory):
    """The completions that bash offers for the last word of a line."""
    script = tmp_path_factory.mktemp("completion") / "abs-service"
    script.write_text(completion.bash(commands))

    def completed(*words):
        program = (
            f'. {script}; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _abs_service; printf "%s\\n" "${{COMPREPLY[@]}}"'
        )
        command = ["bash", "--norc", "-u", "-c", program, "bash", "abs-service", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stderr == ""
        return done.stdout.split()

    return completed


def test_commands(completed):
    assert completed("") == list(cli.COMMANDS)
    assert completed("calib") == ["calibrate"]
    assert completed("re") == [name for name in cli.COMMANDS if name.startswith("re")]


def test_commands_of_a_group_and_their_options(completed):
    assert completed("calibrate", "in") == ["intrinsics"]
    assert "--target" in completed("calibrate", "rig", "--")
    assert "--target" not in completed("run", "--")


def test_options_after_arguments(completed):
    assert completed("run", "rig.toml", "--no-r") == ["--no-record"]
    assert completed("run", "rig.toml", "--log-") == ["--log-level", "--log-format", "--log-file"]


def test_values(completed):
    assert completed("run", "--log-level", "") == ["debug", "info", "warning", "error"]
    assert completed("import", "x", "--layout", "r") == ["realsense", "ros2"]
    assert completed("completion", "b") == ["bash"]


def test_what_may_be_anything_is_left_to_the_names_of_files(completed, commands):
    assert completed("check", "") == []
    assert completed("run", "--out", "") == []
    assert completion.bash(commands).endswith("complete -o default -F _abs_service abs-service\n")


def test_every_command_is_in_every_script(commands, capsys):
    for shell in ("bash", "zsh", "fish"):
        assert cli.main(["completion", shell]) == Exit.OK
        script = capsys.readouterr().out
        names = {word for command in commands for word in command.words.split()}
        assert all(name in script for name in names)


def test_texts_with_quotes_are_quoted_for_fish():
    option = completion.Option(("--rig", "-r"), "the file's \\name", True, ())
    assert completion.fish([completion.Command("run", "", (), (option,))]) == (
        "complete -c abs-service -n '__fish_seen_subcommand_from run' -l rig -s r -r -d 'the file\\'s \\\\name'\n"
    )
