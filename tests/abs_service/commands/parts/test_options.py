"""Options that are numbers refuse what is none of theirs, in every command, as argparse refuses it."""

import argparse
from collections.abc import Iterator
from importlib import import_module

import pytest

from abs_service import cli
from abs_service.supervision.exit_codes import Exit


def numeric_options(name="", commands=cli.COMMANDS, module="abs_service.commands") -> Iterator[tuple[str, str]]:
    """Command and option of all that take one number or several."""
    for each in commands:
        whole_name = f"{name} {each}".strip()
        found = import_module(f"{module}.{cli.MODULES.get(whole_name, each)}")
        if below := getattr(found, "COMMANDS", {}):
            yield from numeric_options(whole_name, below, found.__name__)
            continue
        for action in cli.command_parser(whole_name, found)._actions:  # noqa: SLF001 - argparse has no other way to list them
            if action.option_strings and callable(action.type) and is_number(action.type):
                yield whole_name, action.option_strings[0]


def is_number(read) -> bool:
    """True for a type of arguments that makes a number of a text."""
    try:
        return isinstance(read("5"), int | float)
    except (argparse.ArgumentTypeError, ValueError):
        return False


NUMERIC = list(numeric_options())


def test_there_are_many():
    assert len(NUMERIC) > 20


@pytest.mark.parametrize(("command", "option"), NUMERIC)
@pytest.mark.parametrize("value", ["-3", "nan"])
def test_a_number_that_means_nothing_is_named_with_its_option_and_what_is_allowed(command, option, value, capsys):
    with pytest.raises(SystemExit) as error:
        cli.main([*command.split(), option, *[value] * 4])
    assert error.value.code == Exit.USER
    said = capsys.readouterr().err.splitlines()[-1]
    assert f"argument {option}: '{value}' must be " in said


@pytest.mark.parametrize(
    ("given", "allowed"),
    [
        ("calibrate verify --shots 0", "a number of views from 1 to 10000"),
        ("calibrate rig --shots 0", "a number of views from 1 to 10000"),
        ("calibrate noise --frames 1", "a number of images from 2 to 1000000"),
        ("calibrate target --columns 0", "a number from 1 to 1000"),
        ("keys --days 0", "a number of days from 1 to 3650"),
        ("keys --days 3651", "a number of days from 1 to 3650"),
    ],
)
def test_a_count_says_what_is_allowed(given, allowed, capsys):
    with pytest.raises(SystemExit) as error:
        cli.main(given.split())
    assert error.value.code == Exit.USER
    assert f"must be {allowed}" in capsys.readouterr().err
