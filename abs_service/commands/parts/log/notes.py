"""Log records as notes of a display."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from abs_service.supervision.display import Display
from abs_service.supervision.process_setup import log_lines


class _Notes(logging.Handler):
    def __init__(self, display: Display, formatter: logging.Formatter | None) -> None:
        super().__init__()
        self._display = display
        self.setFormatter(formatter)

    def emit(self, record: logging.LogRecord) -> None:
        self._display.note(self.format(record))


@contextmanager
def logging_to(display: Display, as_json: bool) -> Iterator[None]:
    """Log records as notes of the display, because lines written past it would tear a table apart."""
    root = logging.getLogger()
    before = root.handlers[:]
    root.handlers[:] = [_Notes(display, log_lines.JsonFormatter("run") if as_json else None)]
    try:
        yield
    finally:
        root.handlers[:] = before
