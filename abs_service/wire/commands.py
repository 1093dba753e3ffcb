"""Commands to the parts of a rig, their answers, and a line in health and log for each."""

import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from absmsg.v1.command_pb2 import CommandAnswer, Record, Reinitialize, Reload, SetControls

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample, Subscription
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory
from abs_service.wire.edge import check_sample
from drivers.contract.text import printable
from drivers.encoding.message_content import MessageError

_log = logging.getLogger(__name__)

REINITIALIZE = Reinitialize.DESCRIPTOR.full_name
RECORD = Record.DESCRIPTOR.full_name
RELOAD = Reload.DESCRIPTOR.full_name
SET_CONTROLS = SetControls.DESCRIPTOR.full_name
Command = Reinitialize | Record | Reload | SetControls
_SCHEMAS: Mapping[str, type[Command]] = {
    REINITIALIZE: Reinitialize,
    RECORD: Record,
    RELOAD: Reload,
    SET_CONTROLS: SetControls,
}
ANSWER = CommandAnswer.DESCRIPTOR.full_name

#: Commands of a topic that are logged within a period [ns]; their numbers show that there were more.
LINES, LINES_NS = 10, 1_000_000_000

#: Column and row of a pixel.
Pixel = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Choice:
    """The object that a user chooses in the depth image of a tracker's reference; neither: the region of the rig file.

    Attributes:
        seed: a pixel of it; None without.
        polygon: corners of a polygon around it, in place of a seed; empty without.
    """

    seed: Pixel | None = None
    polygon: tuple[Pixel, ...] = ()

    def __str__(self) -> str:
        """The object's place in words that continue a sentence; "" for the region of the rig file."""
        if self.polygon:
            return f" in a polygon of {len(self.polygon)} corners"
        return f" at pixel {list(self.seed)}" if self.seed else ""


#: The region of the rig file.
AS_CONFIGURED = Choice()


def box(left: int, top: int, right: int, bottom: int) -> tuple[Pixel, ...]:
    """The polygon of a box: from its first column and row to its last, in any order."""
    return (left, top), (right, top), (right, bottom), (left, bottom)


class RefusedError(Exception):
    """A valid command that cannot be carried out; the message is the answer's reason."""


def answer_reinitialize(
    bus: Bus, tracker: str, headers: HeaderFactory, health: Health, act: Callable[[Choice], str]
) -> Subscription:
    """Answers requests to detect the object of a tracker anew; calls `act` for those that are valid.

    Each one is counted, and reported in a line of the log and in a label of health, which recordings keep. `act`, in a
    thread of the transport, detects what was chosen and returns the answer's `region`, or raises RefusedError.
    """

    def on_command(payload: bytes) -> CommandAnswer:
        return CommandAnswer(region=printable(act(_choice(payload))))

    def where(payload: bytes) -> str:
        return str(_choice(payload))

    return answer_valid(bus, keys.reinitialize(tracker), REINITIALIZE, headers, health, on_command, where)


def answer_record(bus: Bus, headers: HeaderFactory, health: Health, act: Callable[[bool], str]) -> Subscription:
    """Answers requests to record, or to wait; counts and logs them as `answer_reinitialize`.

    `act`, in a thread of the transport, records, or waits; it returns why it does not, "" if it does.
    """

    def on_command(payload: bytes) -> CommandAnswer:
        if reason := act(Record.FromString(payload).recording):
            raise RefusedError(reason)
        return CommandAnswer()

    def which(payload: bytes) -> str:
        return " on" if Record.FromString(payload).recording else " off"

    return answer_valid(bus, keys.RECORD, RECORD, headers, health, on_command, which)


def answer_reload(
    bus: Bus, headers: HeaderFactory, health: Health, act: Callable[[], tuple[Sequence[str], Sequence[str]]]
) -> Subscription:
    """Answers requests to read the rig file again; counts and logs them as `answer_reinitialize`.

    `act`, in a thread of the transport, reads it and returns the components that start, or start again, and those that
    end, or raises RefusedError.
    """

    def on_command(payload: bytes) -> CommandAnswer:
        restarts, ends = act()
        return CommandAnswer(restarts=restarts, ends=ends)

    return answer_valid(bus, keys.RELOAD, RELOAD, headers, health, on_command, lambda payload: "")


def reinitialize(
    bus: Bus, tracker: str, headers: HeaderFactory, timeout_s: float, choice: Choice = AS_CONFIGURED
) -> CommandAnswer | None:
    """Asks a tracker to detect its object anew; returns its answer, None if there is none."""
    command = Reinitialize(header=headers.now(0), tracker=tracker)
    if choice.seed is not None:
        command.seed.column, command.seed.row = choice.seed
        command.seed.SetInParent()  # a pixel (0, 0) is one, too
    for column, row in choice.polygon:
        command.polygon.add(column=column, row=row)
    return ask(bus, keys.reinitialize(tracker), command, timeout_s)


def record(bus: Bus, headers: HeaderFactory, recording: bool, timeout_s: float) -> CommandAnswer | None:
    """Asks the recorder to record, or to wait; returns its answer, None if there is none."""
    return ask(bus, keys.RECORD, Record(header=headers.now(0), recording=recording), timeout_s)


def reload(bus: Bus, headers: HeaderFactory, timeout_s: float) -> CommandAnswer | None:
    """Asks a rig to read its file again; returns its answer, None if there is none."""
    return ask(bus, keys.RELOAD, Reload(header=headers.now(0)), timeout_s)


def ask(bus: Bus, topic: str, command: Command, timeout_s: float) -> CommandAnswer | None:
    """Sends a command on its topic; returns its answer, None if there is none."""
    answers = bus.command(topic, command.DESCRIPTOR.full_name, command.SerializeToString(), timeout_s)
    return CommandAnswer.FromString(answers[0].payload) if answers else None


def answer_valid(
    bus: Bus,
    topic: str,
    message: str,
    headers: HeaderFactory,
    health: Health,
    act: Callable[[bytes], CommandAnswer],
    details: Callable[[bytes], str],
) -> Subscription:
    """Answers commands on a topic; counts and logs them as `answer_reinitialize`.

    `act` gets the payload of those that are valid and returns what is particular of their answer, or raises
    RefusedError, or any other error, which is logged; `details` makes what the log says of them.
    """
    logged_ns: deque[int] = deque(LINES * [-LINES_NS], maxlen=LINES)

    def reply(command: Sample) -> bytes:
        now_ns = headers.clock.monotonic()
        if is_logged := now_ns - logged_ns[0] >= LINES_NS:
            logged_ns.append(now_ns)
        reason, sender = _refusal(command, message, headers.rig)
        answer, detail = CommandAnswer(), ""
        if not reason:
            detail = details(command.payload)
            try:
                answer = act(command.payload)
            except RefusedError as error:
                reason = str(error)
            except Exception as error:  # a mistake of ours, which whoever asks has to know of, too
                reason = f"{type(error).__name__}: {error}"
                if is_logged:
                    _log.exception("%s", topic)
        count = health.counted("commands.refused" if reason else "commands.accepted")
        line = printable(f"{topic}{detail} from {sender}: {reason or 'accepted'}")
        if is_logged:  # a program that asks without end must not fill the disk
            _log.warning("command %d: %s", count, line)
        health.label("command", line)
        answer.MergeFrom(CommandAnswer(header=headers.now(count), accepted=not reason, reason=printable(reason)))
        return answer.SerializeToString()

    return bus.answer_commands(topic, ANSWER, reply)


def _refusal(command: Sample, message: str, rig: str) -> tuple[str, str]:
    """Reason for which a command is refused, "" if it is accepted, and its sender."""
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


def _choice(payload: bytes) -> Choice:
    parsed = Reinitialize.FromString(payload)
    seed = (parsed.seed.column, parsed.seed.row) if parsed.HasField("seed") else None
    return Choice(seed, tuple((corner.column, corner.row) for corner in parsed.polygon))
