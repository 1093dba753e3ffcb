"""Commands in README and docs/ have the options that the program knows."""

import argparse
import re
import shlex
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from abs_service.cli import COMMANDS, MODULES, command_parser
from abs_service.commands.parts.log import logs

ROOT = Path(__file__).parents[2]

#: The words after `abs-service` at the beginning of a line. Those that a shell expands by braces are left out.
COMMAND = re.compile(r"^(?:(?:\.\./)?\.venv/bin/)?abs-service ([^{\n]+)$", re.MULTILINE)


def documented() -> Iterator[tuple[str, list[str]]]:
    """Page and words of every command in a block for the shell."""
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
        for block in re.findall(r"```sh\n(.*?)```", path.read_text("utf-8"), re.DOTALL):
            for command in COMMAND.findall(block.replace("\\\n", " ")):
                yield path.relative_to(ROOT).as_posix(), _words(command)


def _words(command: str) -> list[str]:
    """Words of a command up to a comment or to what is for the shell."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars="|<>&;")
    lexer.whitespace_split = True
    words = list(lexer)
    return words[: next((k for k, word in enumerate(words) if set(word) <= set("|<>&;")), len(words))]


def parse(given: list[str]) -> None:
    """Parses a command as the program does; SystemExit if it is wrong."""
    name, commands, module = "", COMMANDS, import_module("abs_service.commands")
    while commands:
        chosen, *given = given
        name = f"{name} {chosen}".strip()
        module = import_module(f"{module.__name__}.{MODULES.get(name, chosen)}")
        commands = getattr(module, "COMMANDS", {})
    parser = command_parser(name, module)
    logs.add_arguments(parser)
    parser.parse_args(given, argparse.Namespace(commands=COMMANDS, modules=MODULES, reconfigured=None))


def test_every_documented_command_has_options_that_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    wrong, found = [], list(documented())
    assert len(found) > 60
    for page, words in found:
        try:
            parse(words)
        except SystemExit:
            wrong.append(f"{page}: {shlex.join(words)}: {capsys.readouterr().err.splitlines()[-1]}")
    assert wrong == []


def test_an_option_that_there_is_not_is_found(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(["info", "x.mcap", "--yaml"])
    assert "--yaml" in capsys.readouterr().err
