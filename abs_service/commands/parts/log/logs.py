"""The log of every command: its options, its destination, and the part that the processes of `run` inherit."""

import argparse
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, cast

import abs_service
from abs_service.display.terminal import output
from abs_service.supervision.exit_codes import code_for, is_for_user
from abs_service.supervision.process_setup.log_lines import ERROR, JsonFormatter
from drivers.contract.text import printable

LEVELS = ("debug", "info", "warning", "error")

_log = logging.getLogger("abs_service")


class LogFileError(Exception):
    """The file of the log cannot be written."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds --log-level, --log-format and --log-file."""
    group = parser.add_argument_group("log")
    group.add_argument("--log-level", choices=LEVELS, default="warning", help="least level (default: %(default)s)")
    group.add_argument(
        "--log-format",
        choices=("text", "json"),
        default="text",
        help="json: one object a line with time, level, process, message, fields (default: text)",
    )
    group.add_argument(
        "--log-file", metavar="FILE", type=Path, help="append the log to this file instead of standard error"
    )


def options(arguments: argparse.Namespace) -> list[str]:
    """The options of the log, to give to another command."""
    file = ["--log-file", str(arguments.log_file.resolve())] if arguments.log_file else []
    return ["--log-level", arguments.log_level, "--log-format", arguments.log_format, *file]


def on_stderr(arguments: argparse.Namespace) -> bool:
    """True if the log on standard error should be JSON."""
    return arguments.log_format == "json" and not arguments.log_file


def set_up(arguments: argparse.Namespace, command: str, given: Sequence[str]) -> None:
    """Opens the log of this process, and logs its command line.

    Args:
        arguments: with the options of the log.
        command: name of the command.
        given: its arguments as they were given.

    Raises:
        LogFileError: the file cannot be written.
    """
    process = "/".join(filter(None, [command, getattr(arguments, "tracker", None)]))
    handler = _handler(arguments.log_file)
    where = f" {process}" if arguments.log_file else ""  # several processes write into one file
    text = logging.Formatter(f"%(asctime)s %(levelname)s{where} %(name)s: %(message)s")
    handler.setFormatter(JsonFormatter(process) if arguments.log_format == "json" else text)
    logging.basicConfig(level=arguments.log_level.upper(), handlers=[handler])
    fields = {"version": abs_service.__version__, "arguments": list(given)}
    _log.info("abs-service %s %s", command, abs_service.__version__, extra={"fields": fields})


@contextmanager
def in_background() -> Iterator[None]:
    """Context in which nothing waits for a halted reader of standard error, such as a terminal after Ctrl-S."""
    handlers = [one for one in logging.getLogger().handlers if getattr(one, "stream", None) is sys.stderr]
    with output.of(sys.stderr) as background:
        for handler in handlers:
            cast(logging.StreamHandler[IO[str]], handler).setStream(background.file)
        try:
            yield
        finally:
            for handler in handlers:
                cast(logging.StreamHandler[IO[str]], handler).setStream(sys.stderr)


def end_with(error: Exception, arguments: argparse.Namespace) -> int:
    """Tells the error that ends a command; returns its exit code.

    Raises:
        Exception: the error itself, if it is our own mistake and standard error is for people.
    """
    user, code = is_for_user(error), code_for(error)
    if not isinstance(error, LogFileError) and (arguments.log_file or arguments.log_format == "json"):
        text = str(error) if user else f"{type(error).__name__}: {error}"
        _log.critical("%s", text, extra={"fields": {"exit_code": int(code)}}, exc_info=None if user else error)
    if not on_stderr(arguments):
        if not user:
            raise error
        print(f"{ERROR}{printable(str(error))}", file=sys.stderr)
    return code


def _handler(file: Path | None) -> logging.Handler:
    if file is None:
        return logging.StreamHandler(sys.stderr)
    from multiprocessing import parent_process  # noqa: PLC0415 - these are needed for a file only

    from abs_service.commands.parts.log.log_file import InBackground, LogFile  # noqa: PLC0415

    # `run` has opened it: what has become of it since keeps none of its processes from starting again.
    is_of_run = parent_process() is not None
    try:
        return InBackground(LogFile(file, encoding="utf-8", delay=is_of_run))
    except OSError as error:
        raise LogFileError(f"--log-file {file}: cannot be written: {error.strerror}") from None
