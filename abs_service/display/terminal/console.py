"""Rich's console for tables on standard output."""

from rich.console import Console


class TableConsole(Console):
    """A console that leaves the end of its reader to the command, as a plain `print` does; Rich would exit with 1."""

    def on_broken_pipe(self) -> None:
        """See `rich.console.Console`.

        Raises:
            BrokenPipeError: always.
        """
        raise BrokenPipeError
