import json
import logging
import sys

import pytest

from abs_service.supervision.process_setup import log_lines


def record(message, *args, level=logging.WARNING, error=None, **fields):
    made = logging.LogRecord("abs_service.part", level, "part.py", 1, message, args, error)
    made.fields = fields
    return log_lines.JsonFormatter("track/sheet").format(made)


def test_a_record_is_one_line_of_json():
    found = json.loads(record("%s of %s\nframes", 2, 3, stream="tof/depth"))
    assert list(found) == ["time", "level", "process", "message", "fields"]
    assert (found["level"], found["process"], found["message"]) == ("warning", "track/sheet", "2 of 3\nframes")
    assert found["time"].endswith("Z")
    assert found["fields"]["logger"] == "abs_service.part"
    assert found["fields"]["stream"] == "tof/depth"
    assert "\n" not in record("a\nb")


def test_an_exception_is_in_the_fields():
    try:
        raise ZeroDivisionError("by zero")
    except ZeroDivisionError:
        found = json.loads(record("broke", error=sys.exc_info()))
    assert found["fields"]["exception"].endswith("ZeroDivisionError: by zero")


@pytest.mark.parametrize("text", ["plain", '{"time": ', '{"a": 1}', "[1]", ""])
def test_what_is_no_record_is_its_own_message(text):
    assert log_lines.parse(text) == {}
    assert log_lines.message(text) == text


def test_the_error_that_ended_a_command_is_found_in_its_output():
    final = record("no camera\nat all", exit_code=2)
    assert log_lines.is_final(final)
    assert not log_lines.is_final(record("no camera"))
    assert log_lines.final_error(f"{record('before')}\n{final}") == "no camera\nat all"
    assert log_lines.final_error("before\nabs-service: error: two\n  lines") == "two\n  lines"
    assert log_lines.final_error("Killed") == "Killed"
