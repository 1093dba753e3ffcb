"""Commands to a tracker and to the recorder: what may be asked, the answer, and a line in health and log for each."""

import logging
from collections.abc import Callable, Mapping

from absmsg.v1.command_pb2 import CommandAnswer, Record, Reinitialize

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample, Subscription
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory
from abs_service.wire.edge import check_sample
from drivers.contract.text import printable
from drivers.encoding.message_check import MessageError

_log = logging.getLogger(__name__)

REINITIALIZE = Reinitialize.DESCRIPTOR.full_name
RECORD = Record.DESCRIPTOR.full_name
_SCHEMAS: Mapping[str, type[Reinitialize | Record]] = {REINITIALIZE: Reinitialize, RECORD: Record}
ANSWER = CommandAnswer.DESCRIPTOR.full_name


def answer_reinitialize(
    bus: Bus, tracker: str, headers: HeaderFactory, health: Health, act: Callable[[], None]
) -> Subscription:
    """Answers requests to detect the object of a tracker anew; calls `act` for those that are valid.

    Each one is counted, and told in a line of the log and in a label of health, which recordings keep.

    Args:
        bus: of the rig.
        tracker: its name.
        headers: of the answers.
        health: of the tracker.
        act: detects anew; called from a thread of the transport.
    """

    def on_command(payload: bytes) -> str:
        act()
        return ""

    return _answer(bus, keys.reinitialize(tracker), REINITIALIZE, headers, health, on_command)


def answer_record(bus: Bus, headers: HeaderFactory, health: Health, act: Callable[[bool], str]) -> Subscription:
    """Answers requests to record, or to wait; counts and tells them as `answer_reinitialize`.

    Args:
        bus: of the rig.
        headers: of the answers.
        health: of the recorder.
        act: records, or waits; returns why it does not, "" if it does. Called from a thread of the transport.
    """
    return _answer(bus, keys.RECORD, RECORD, headers, health, lambda payload: act(Record.FromString(payload).recording))


def reinitialize(bus: Bus, tracker: str, headers: HeaderFactory, timeout_s: float) -> CommandAnswer | None:
    """Asks a tracker to detect its object anew; returns its answer, None if there is none."""
    command = Reinitialize(header=headers.now(0), tracker=tracker).SerializeToString()
    answers = bus.command(keys.reinitialize(tracker), REINITIALIZE, command, timeout_s)
    return CommandAnswer.FromString(answers[0].payload) if answers else None


def record(bus: Bus, headers: HeaderFactory, recording: bool, timeout_s: float) -> CommandAnswer | None:
    """Asks the recorder to record, or to wait; returns its answer, None if there is none."""
    command = Record(header=headers.now(0), recording=recording).SerializeToString()
    answers = bus.command(keys.RECORD, RECORD, command, timeout_s)
    return CommandAnswer.FromString(answers[0].payload) if answers else None


def _answer(
    bus: Bus, topic: str, message: str, headers: HeaderFactory, health: Health, act: Callable[[bytes], str]
) -> Subscription:
    """Answers commands on a topic; `act` gets the payload of those that are valid and returns why they are refused."""

    def answer(command: Sample) -> bytes:
        reason, sender = _refusal(command, message, headers.rig)
        reason = reason or act(command.payload)
        count = health.counted("commands.refused" if reason else "commands.accepted")
        line = printable(f"{topic} from {sender}: {reason or 'accepted'}")
        _log.warning("command %d: %s", count, line)
        health.label("command", line)
        header = headers.now(count)
        return CommandAnswer(header=header, accepted=not reason, reason=printable(reason)).SerializeToString()

    return bus.answer_commands(topic, ANSWER, answer)


def _refusal(command: Sample, message: str, rig: str) -> tuple[str, str]:
    """Why a command is refused, "" if it is not, and who sent it."""
    sender = "an unknown process"
    try:
        if command.message != message:
            return f"{command.message[:100]!r} is no {message}", sender
        check_sample(command)
    except MessageError as error:
        return str(error), sender
    header = _SCHEMAS[message].FromString(command.payload).header
    if header.boot_id:
        sender = f"process {header.boot_id} on {header.host_clock}"
    return "" if header.rig == rig else f"it is for rig {header.rig!r}", sender
