"""A program of a child process: Python code."""

from collections.abc import Sequence


def run(arguments: Sequence[str]) -> None:
    """Runs the first argument."""
    exec(arguments[0], {"__name__": "code"})
