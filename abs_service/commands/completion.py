"""Prints a script that completes commands, options and their values in a shell.

  abs-service completion bash > ~/.local/share/bash-completion/completions/abs-service
  abs-service completion zsh > ~/.zsh/abs-service.zsh         and `source ~/.zsh/abs-service.zsh` in ~/.zshrc
  abs-service completion fish > ~/.config/fish/completions/abs-service.fish

The script is made from the commands of this version; make it again after an update.
"""

import argparse
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module

from abs_service.commands.parts.log import logs
from abs_service.supervision.exit_codes import Exit


@dataclass(frozen=True)
class Option:
    """An option: its names, its help, whether a value follows, and the values that it may have (none: any)."""

    names: Sequence[str]
    text: str
    takes_value: bool
    values: Sequence[str]


@dataclass(frozen=True)
class Command:
    """A command as it is typed (`calibrate rig`): its help, commands below it, options, and values of its arguments."""

    words: str
    text: str
    below: Sequence[str] = ()
    options: Sequence[Option] = ()
    values: Sequence[str] = ()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `abs-service completion`."""
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="what the script is for")


def run(arguments: argparse.Namespace) -> int:
    """Prints the script."""
    commands = list(found("", arguments.commands, arguments.modules, "abs_service.commands"))
    scripts = {"bash": bash, "zsh": lambda some: _ZSH + bash(some), "fish": fish}
    print(scripts[arguments.shell](commands), end="")
    return Exit.OK


def found(words: str, commands: Mapping[str, str], modules: Mapping[str, str], package: str) -> Iterator[Command]:
    """A group of commands and all below it. Imports their modules.

    Args:
        words: the group as it is typed; "" for all commands.
        commands: its commands with their help.
        modules: modules of commands that are not called as these are.
        package: dotted name of the package with the modules.
    """
    yield Command(words, "", tuple(commands))
    for name, text in commands.items():
        module = import_module(f"{package}.{modules.get(name, name)}")
        typed = f"{words} {name}".strip()
        if below := getattr(module, "COMMANDS", {}):
            yield from found(typed, below, {}, module.__name__)
            continue
        parser = argparse.ArgumentParser()
        module.add_arguments(parser)
        logs.add_arguments(parser)
        actions = parser._actions  # noqa: SLF001 - argparse has no other way to list them
        options = tuple(_option(action) for action in actions if action.option_strings)
        arguments = (action for action in actions if not action.option_strings)
        yield Command(typed, text, (), options, tuple(v for one in arguments for v in _values(one)))


def bash(commands: Sequence[Command]) -> str:
    """The script for bash. Arguments without fixed values are completed with file names."""
    values, options, groups = [], [], []
    for command in commands:
        words = shlex.quote(command.words)
        if command.below:
            groups.append(f"        {words}) words={shlex.quote(' '.join(command.below))} ;;")
            continue
        names = " ".join(name for option in command.options for name in option.names)
        arguments = shlex.quote(" ".join(command.values))
        options.append(f"        {words}) [[ $now == -* ]] && words={shlex.quote(names)} || words={arguments} ;;")
        for option in command.options:
            if option.values:
                places = "|".join(shlex.quote(f"{command.words} {name}") for name in option.names)
                values.append(f"        {places}) words={shlex.quote(' '.join(option.values))} ;;")
    prefixes = "|".join(shlex.quote(command.words) for command in commands if command.below and command.words)
    return _BASH.format(prefixes=prefixes, values="\n".join(values), rest="\n".join([*groups, *options]))


def fish(commands: Sequence[Command]) -> str:
    """The script for fish."""
    lines = []
    for command in commands:
        seen = [f"__fish_seen_subcommand_from {word}" for word in command.words.split()]
        if command.below:
            texts = {one.words: one.text for one in commands}
            free = f"not __fish_seen_subcommand_from {' '.join(command.below)}"
            for name in command.below:
                text = texts.get(f"{command.words} {name}".strip(), "")
                lines.append(_fish("; and ".join([*seen, free]), f"-f -a {name}", text))
        for option in command.options:
            names = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in option.names)
            value = f" -x -a {shlex.quote(' '.join(option.values))}" if option.values else " -r" * option.takes_value
            lines.append(_fish("; and ".join(seen), f"{names}{value}", option.text))
        if command.values:
            lines.append(_fish("; and ".join(seen), f"-f -a {shlex.quote(' '.join(command.values))}", ""))
    return "\n".join(lines) + "\n"


def _fish(condition: str, what: str, text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"complete -c abs-service -n '{condition}' {what}" + (f" -d '{escaped}'" if text else "")


def _option(action: argparse.Action) -> Option:
    text = (action.help or "") % {**vars(action), "prog": "abs-service"}
    return Option(tuple(action.option_strings), text, action.nargs != 0, _values(action))


def _values(action: argparse.Action) -> tuple[str, ...]:
    return tuple(map(str, action.choices or ()))


_ZSH = "autoload -U +X compinit bashcompinit && compinit && bashcompinit\n"

_BASH = """\
_abs_service() {{
    local now=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} command="" words=""
    if ((COMP_CWORD > 1)); then command=${{COMP_WORDS[1]}}; fi
    case $command in
        {prefixes}) if ((COMP_CWORD > 2)); then command="$command ${{COMP_WORDS[2]}}"; fi ;;
    esac
    case "$command $before" in
{values}
        *) case $command in
{rest}
        esac ;;
    esac
    COMPREPLY=($(compgen -W "$words" -- "$now"))
}}
complete -o default -F _abs_service abs-service
"""
