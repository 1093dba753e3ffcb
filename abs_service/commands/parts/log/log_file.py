"""The file of `--log-file`."""

import logging
import os
import sys
import threading
from contextlib import suppress
from io import TextIOWrapper
from logging.handlers import QueueHandler, WatchedFileHandler
from queue import Full, Queue

#: Records that may wait for a disk that stands still.
WAITING = 1000
#: Time that the disk has for what is left when a process ends [s].
END_S = 1.0


class LogFile(WatchedFileHandler):
    """A file that is opened again after it was moved by logrotate, or could not be opened.

    Records that cannot be written, as on a full disk or in a folder that is gone, end nobody's work. They are reported
    on standard error: the first, and how many there were when one can be written again. A pipe without a reader takes
    no record, nor does one whose reader stands still.
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
        self.lose(error.strerror or str(error))

    def lose(self, reason: str) -> None:
        """Counts a record that cannot be written, and tells the reason of the first."""
        self._lost += 1
        if self._lost == 1:
            self._tell(f"cannot be written: {reason}")

    def _tell(self, what: str) -> None:
        with suppress(OSError):
            print(f"abs-service: --log-file {self.baseFilename} {what}", file=sys.stderr, flush=True)


class InBackground(QueueHandler):
    """Lets a thread write the records: nobody waits for a disk that stands still.

    Args:
        file: takes the records, which this has formatted.
    """

    def __init__(self, file: LogFile) -> None:
        self._records: Queue[logging.LogRecord | None] = Queue(WAITING)
        super().__init__(self._records)
        self._file = file
        self._thread = threading.Thread(target=self._write, name="log file", daemon=True)
        self._thread.start()

    def enqueue(self, record: logging.LogRecord) -> None:
        """See `logging.handlers.QueueHandler`."""
        try:
            self._records.put_nowait(record)
        except Full:
            self._file.lose("it stands still")

    def close(self) -> None:
        """Waits until all is written, but not for long."""
        with suppress(Full):
            self._records.put(None, timeout=END_S)
            self._thread.join(END_S)
        if self._thread.is_alive():
            self._file.lose(f"it stands still, {self._records.qsize()} records are missing")
        super().close()

    def _write(self) -> None:
        while (record := self._records.get()) is not None:
            self._file.handle(record)


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK, 0o666)
