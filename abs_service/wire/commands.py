"""Commands to a tracker: what may be asked, the answer, and a line in health and log for each."""

import logging
from collections.abc import Callable

from absmsg.v1.command_pb2 import CommandAnswer, Reinitialize

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample, Subscription
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory
from abs_service.wire.edge import check_sample
from drivers.contract.text import printable
from drivers.encoding.message_check import MessageError

_log = logging.getLogger(__name__)

REINITIALIZE = Reinitialize.DESCRIPTOR.full_name
ANSWER = CommandAnswer.DESCRIPTOR.full_name

#: Column and row of a pixel.
Pixel = tuple[int, int]


class RefusedError(Exception):
    """A valid command that cannot be carried out; the message is the answer's reason."""


def answer_reinitialize(
    bus: Bus, tracker: str, headers: HeaderFactory, health: Health, act: Callable[[Pixel | None], str]
) -> Subscription:
    """Answers requests to detect the object of a tracker anew; calls `act` for those that are valid.

    Each one is counted, and told in a line of the log and in a label of health, which recordings keep.

    Args:
        bus: of the rig.
        tracker: its name.
        headers: of the answers.
        health: of the tracker.
        act: detects anew, at a pixel if there is one, and returns the answer's `region`, or raises RefusedError; called
            from a thread of the transport.
    """

    def answer(command: Sample) -> bytes:
        reason, sender = _refusal(command, headers.rig)
        region, where = "", ""
        if not reason:
            seed = _seed(command)
            where = f" at {list(seed)}" if seed else ""
            try:
                region = act(seed)
            except RefusedError as error:
                reason = str(error)
        count = health.counted("commands.refused" if reason else "commands.accepted")
        line = printable(f"{keys.reinitialize(tracker)}{where} from {sender}: {reason or 'accepted'}")
        _log.warning("command %d: %s", count, line)
        health.label("command", line)
        said = CommandAnswer(
            header=headers.now(count), accepted=not reason, reason=printable(reason), region=printable(region)
        )
        return said.SerializeToString()

    return bus.answer_commands(keys.reinitialize(tracker), ANSWER, answer)


def reinitialize(
    bus: Bus, tracker: str, headers: HeaderFactory, timeout_s: float, seed: Pixel | None = None
) -> CommandAnswer | None:
    """Asks a tracker to detect its object anew; returns its answer, None if there is none.

    Args:
        bus: of the rig.
        tracker: its name.
        headers: of this process.
        timeout_s: of the answer [s].
        seed: a pixel of the object in the depth image of the tracker's reference; None: the region of its rig file.
    """
    command = Reinitialize(header=headers.now(0), tracker=tracker)
    if seed is not None:
        command.seed.column, command.seed.row = seed
        command.seed.SetInParent()  # a pixel (0, 0) is one, too
    answers = bus.command(keys.reinitialize(tracker), REINITIALIZE, command.SerializeToString(), timeout_s)
    return CommandAnswer.FromString(answers[0].payload) if answers else None


def _refusal(command: Sample, rig: str) -> tuple[str, str]:
    """Why a command is refused, "" if it is not, and who sent it."""
    sender = "an unknown process"
    try:
        if command.message != REINITIALIZE:
            return f"{command.message[:100]!r} is no {REINITIALIZE}", sender
        check_sample(command)
    except MessageError as error:
        return str(error), sender
    header = Reinitialize.FromString(command.payload).header
    if header.boot_id:
        sender = f"process {header.boot_id} on {header.host_clock}"
    return "" if header.rig == rig else f"it is for rig {header.rig!r}", sender


def _seed(command: Sample) -> Pixel | None:
    parsed = Reinitialize.FromString(command.payload)
    return (parsed.seed.column, parsed.seed.row) if parsed.HasField("seed") else None
