"""Requests of the page to the recorder, answered in words."""

from collections.abc import Callable

from absmsg.v1.command_pb2 import CommandAnswer

#: Asks the recorder to record, or to wait; returns its answer, None if there is none.
Record = Callable[[bool], CommandAnswer | None]


def ask(send: Record, recording: bool) -> str:
    """Asks the recorder to record, or to wait, and returns its answer in words.

    Args:
        send: sends the command.
        recording: True begins with the seconds before, False ends.
    """
    answer = send(recording)
    if answer is None:
        return "The recorder gives no answer. Does it run?"
    if not answer.accepted:
        return f"The recorder refuses: {answer.reason}."
    return "The recorder records." if recording else "The recorder waits for the next trigger."
