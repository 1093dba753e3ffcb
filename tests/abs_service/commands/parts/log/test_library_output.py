"""Output of zenoh to standard output becomes lines of the log."""

import os
import subprocess
import sys

from abs_service.commands.parts.log import library_output

REFUSED = (
    "\x1b[2m2026-11-24T03:06:25.156251Z\x1b[0m \x1b[33m WARN\x1b[0m acc-0 ThreadId(05) \x1b[2mzenoh_link_tls::unicast"
    "\x1b[0m\x1b[2m:\x1b[0m peer sent no certificates. Hint: increase the system open file limit."
)


def test_refusals_are_said_without_wrong_advice():
    assert library_output.plain(REFUSED) == "a client was refused: peer sent no certificates."
    assert library_output.plain("2026Z ERROR ThreadId(01) zenoh::a: it broke") == "it broke"
    assert library_output.plain("hello\n") == "hello"
    assert "\x1b" not in library_output.plain("\x1b]0;title\x07")


def test_a_line_that_repeats_is_passed_on_once_in_ten_seconds_with_a_count():
    now = [0.0]
    repetitions = library_output.Repetitions(lambda: now[0])
    assert [repetitions.line(text) for text in ("a", "a", "b", "a")] == ["a", "", "b", ""]
    now[0] = 10.0
    assert repetitions.line("a") == "a (2 times more since)"
    now[0] = 20.0
    assert repetitions.line("a") == "a"


def test_lines_past_python_are_logged_and_those_of_python_stay_where_they_were():
    program = """
import logging, os
from abs_service.commands.parts.log import library_output
logging.basicConfig(format="%(levelname)s %(message)s")
print("before")
with library_output.logged():
    os.write(1, b"from a library\\n")
    print("within")
print("after")
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert (ended.stdout, ended.stderr) == ("before\nwithin\nafter\n", "WARNING from a library\n")
