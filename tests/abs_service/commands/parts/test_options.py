"""Options that are numbers refuse what is none of theirs, in every command, as argparse refuses it."""

from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import redirect_stderr, suppress
from importlib import import_module
from io import StringIO

import pytest

from abs_service import cli
from abs_service.commands import completion
from abs_service.supervision.exit_codes import Exit


def numeric_options() -> Iterator[tuple[str, str]]:
    """Command and option of all that take one number or several."""
    for command in completion.found("", cli.COMMANDS, cli.MODULES, "abs_service.commands"):
        for name in [option.names[0] for option in command.options if option.takes_value]:
            parser = parser_of(command.words)
            if refuses(parser, name, "word") and not refuses(parser, name, "5"):
                yield command.words, name


def parser_of(words: str) -> ArgumentParser:
    """The parser of a command."""
    module = import_module("abs_service.commands")
    for number, word in enumerate(words.split(), 1):
        module = import_module(f"{module.__name__}.{cli.MODULES.get(' '.join(words.split()[:number]), word)}")
    return cli.command_parser(words, module)


def refuses(parser: ArgumentParser, option: str, value: str) -> bool:
    """True if a parser says that an option cannot have a value; what else a command needs is said later."""
    with redirect_stderr(StringIO()) as said, suppress(SystemExit):
        parser.parse_args([option, *[value] * 6])
    return f"argument {option}" in said.getvalue()


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
