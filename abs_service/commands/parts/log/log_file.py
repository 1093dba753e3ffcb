"""The file of `--log-file`."""

import logging
import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from logging.handlers import WatchedFileHandler


class LogFile(WatchedFileHandler):
    """A file that is opened again after it was moved by logrotate, or could not be opened.

    Records that cannot be written, as on a full disk or in a folder that is gone, end nobody's work. They are told on
    standard error: the first, and how many there were when one can be written again. A pipe without a reader takes no
    record, nor does one whose reader stands still.
    """

    _lost = 0

    def emit(self, record: logging.LogRecord) -> None:
        """See `logging.Handler`."""
        before = self._lost
        try:
            super().emit(record)
        except OSError:  # of opening it again
            self.handleError(record)
        if self._lost == before > 0:
            self._lost = 0
            self._tell(f"can be written again, {before} records are missing")

    def _open(self) -> TextIOWrapper:
        return open(self.baseFilename, "a", encoding=self.encoding, errors=self.errors, opener=_without_waiting)

    def handleError(self, record: logging.LogRecord) -> None:
        """See `logging.Handler`."""
        error = sys.exc_info()[1]
        if not isinstance(error, OSError):
            super().handleError(record)
            return
        self._lost += 1
        if self._lost == 1:
            self._tell(f"cannot be written: {error.strerror}")

    def _tell(self, what: str) -> None:
        with suppress(OSError):
            print(f"abs-service: --log-file {self.baseFilename} {what}", file=sys.stderr, flush=True)


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK, 0o666)
