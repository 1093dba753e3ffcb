"""The display of a rig that fits the output."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console

from abs_service.display.terminal import journal, output
from abs_service.display.terminal.journal import JournalDisplay
from abs_service.display.terminal.lines import JsonDisplay, PlainDisplay
from abs_service.display.terminal.output import Background
from abs_service.display.terminal.table import TableDisplay
from abs_service.supervision.display import Display


@contextmanager
def shown(as_json: bool) -> Iterator[Display]:
    """A display: JSON, the live table in a terminal, the journal of systemd, or plain lines elsewhere."""
    if not as_json and journal.is_attached(os.environ, sys.stderr.fileno()):
        with Background(journal.send) as entries, JournalDisplay(entries.put) as display:
            yield display
        return
    with output.of(sys.stdout) as out, output.of(sys.stderr) as notes:
        if as_json:
            chosen = JsonDisplay(out, notes)
        elif sys.stdout.isatty():
            chosen = TableDisplay(Console(file=out.file, force_terminal=True), out)
        else:
            chosen = PlainDisplay(out, notes)
        with chosen as display:
            yield display
