"""Log records as lines of JSON, one object each: `time`, `level`, `process`, `message` and `fields`."""

import json
import logging
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

#: What a command writes before the message of an error that ends it.
ERROR = "abs-service: error: "


class JsonFormatter(logging.Formatter):
    """Formats a record as one line. `extra={"fields": {…}}` of a call adds to the fields `logger`, `pid`, `exception`.

    Args:
        process: name of the process: `run`, `capture`, `track/sheet`.
    """

    def __init__(self, process: str) -> None:
        super().__init__()
        self._process = process

    def format(self, record: logging.LogRecord) -> str:
        """See `logging.Formatter`."""
        fields: dict[str, Any] = {"logger": record.name, "pid": record.process, **getattr(record, "fields", {})}
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        return line(record.created, record.levelname.lower(), self._process, record.getMessage(), fields)


def line(time_s: float, level: str, process: str, message: str, fields: Mapping[str, Any]) -> str:
    """One record. `time_s` is seconds since 1970; values without a type in JSON are written as text."""
    time = datetime.fromtimestamp(time_s, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
    record = {"time": time, "level": level, "process": process, "message": message, "fields": fields}
    return json.dumps(record, ensure_ascii=False, default=str)


def parse(text: str) -> Mapping[str, Any]:
    """The record in a line; empty if it is none."""
    try:
        record = json.loads(text) if text.startswith('{"time": ') else {}
    except ValueError:
        return {}
    return record if isinstance(record, dict) and "message" in record else {}


def message(text: str) -> str:
    """The message of a line that a process wrote, be it a record or not."""
    return str(parse(text).get("message", text))


def is_final(text: str) -> bool:
    """True for the line with the error that ended a command."""
    return text.startswith(ERROR) or "exit_code" in parse(text).get("fields", {})


def final_error(output: str) -> str:
    """The error that ended a command, in its output; all of the output if there is none."""
    last = output.rpartition("\n")[2]
    return message(last) if is_final(last) and not last.startswith(ERROR) else output.rpartition(ERROR)[2]
