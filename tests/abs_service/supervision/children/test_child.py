"""The end of a process in words."""

import pytest

from abs_service.supervision.children.child import exit_reason

ERROR = "abs-service: error: can't start new thread"
LEFT = "abs-service: left behind, since they do not end: Thread-1"


@pytest.mark.parametrize(
    ("output", "reason"),
    [
        ("", "ended with code 1"),
        ("one\ntwo\n", "ended with code 1: two"),
        (f"one\n{ERROR}\n", f"ended with code 1: {ERROR}"),
        (f"one\n{ERROR}\n{LEFT}\n", f"ended with code 1: {ERROR}"),
    ],
)
def test_the_reason_is_the_error_whatever_is_said_after_it(output, reason):
    assert exit_reason(1, output) == reason
