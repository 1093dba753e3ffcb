"""Progress bars on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager

from numba.core import event
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

#: What Numba calls the compilation of a function that is not in its cache.
_COMPILATION = "numba:compile"


@contextmanager
def bars(disable: bool = False) -> Iterator[Progress]:
    """Bars with a text, a number of a total, and the time that is left; kernels have one while they are compiled.

    They vanish at the end, as the results say what was done, and are not shown where no terminal is.

    Args:
        disable: True to show nothing.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    shown = console.is_terminal and not disable
    with Progress(*columns, console=console, disable=not shown, transient=True) as progress:
        # How many will be missing in the cache is known only when they are.
        task = progress.add_task("compiling kernels", total=None, visible=False)
        with event.install_listener(_COMPILATION, _Compilations(progress, task)):
            yield progress


class _Compilations(event.Listener):
    """Counts the kernels that are compiled; functions within one are compiled with it and do not count."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress = progress
        self._task = task
        self._depth = 0

    def on_start(self, event: event.Event) -> None:
        self._depth += 1
        self._progress.update(self._task, visible=True)

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        if not self._depth:
            self._progress.advance(self._task)
