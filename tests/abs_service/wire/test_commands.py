"""A tracker acts on valid commands only, answers each, and leaves a line about it."""

import logging

import pytest
from absmsg.v1.command_pb2 import CommandAnswer, Reinitialize
from absmsg.v1.common_pb2 import Header

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.wire import commands
from tests.abs_service.bus.loopback import LoopbackBus, health_now
from tests.waiting import eventually

OUTSIDE = commands.Choice(seed=(700, 3))
TRIANGLE = ((80, 90), (160, 90), (120, 170))
REGION = '[trackers.sheet.region]\ntype = "seed"\npixel = [111, 133]\n'
SENDER = Header(rig="demo", boot_id="5f1c", host_clock="0b6c")


def drawn(*rows, **others):
    """A command with a polygon of corners in these rows."""
    polygon = [Reinitialize.Pixel(column=row % 7, row=row) for row in rows]
    return Reinitialize(tracker="sheet", header=SENDER, polygon=polygon, **others).SerializeToString()


class Bench:
    """A tracker called sheet that counts how often it was told to detect its object anew."""

    def __init__(self, bus=None):
        self.bus, self.acted, self.choices = bus or LoopbackBus(), 0, []
        self.headers = HeaderFactory("demo", WallClock())
        self.health_bus = LoopbackBus()
        self.health = Health(self.health_bus, "track/sheet", self.headers)
        commands.answer_reinitialize(self.bus, "sheet", self.headers, self.health, self.act)

    def act(self, choice):
        self.acted += 1
        self.choices.append(choice)
        if choice == OUTSIDE:
            raise commands.RefusedError("the pixel is outside the image")
        return "" if choice == commands.AS_CONFIGURED else REGION

    @property
    def said(self):
        return health_now(self.health, self.health_bus)


def test_a_command_is_carried_out_answered_and_told(caplog):
    bench = Bench()
    with caplog.at_level(logging.WARNING):
        answer = commands.reinitialize(bench.bus, "sheet", bench.headers, 1.0)
    assert answer is not None
    assert (answer.accepted, answer.reason, bench.choices) == (True, "", [commands.AS_CONFIGURED])
    assert bench.said.counters["commands.accepted"] == 1
    line = f"sheet/reinitialize from process {bench.headers.boot_id} on {bench.headers.host_clock}: accepted"
    assert bench.said.labels["command"] == line
    assert line in caplog.text


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        (commands.Choice(seed=(111, 133)), " at pixel [111, 133]"),
        (commands.Choice(seed=(0, 0)), " at pixel [0, 0]"),
        (commands.Choice(polygon=TRIANGLE), " in a polygon of 3 corners"),
    ],
)
def test_a_choice_arrives_and_the_answer_says_how_to_keep_it(choice, words):
    bench = Bench()
    answer = commands.reinitialize(bench.bus, "sheet", bench.headers, 1.0, choice)
    assert answer is not None
    assert (answer.accepted, answer.region, bench.choices) == (True, REGION, [choice])
    assert f"sheet/reinitialize{words} from" in bench.said.labels["command"]


def test_a_seed_that_the_tracker_cannot_use_is_refused_and_told():
    bench = Bench()
    answer = commands.reinitialize(bench.bus, "sheet", bench.headers, 1.0, OUTSIDE)
    assert answer is not None
    assert (answer.accepted, answer.reason, answer.region) == (False, "the pixel is outside the image", "")
    assert bench.said.counters["commands.refused"] == 1
    assert "at pixel [700, 3] from" in bench.said.labels["command"]


@pytest.mark.parametrize(
    ("message", "payload", "reason"),
    [
        ("", b"", "'' is no absmsg.v1.Reinitialize"),
        ("absmsg.v1.Header", SENDER.SerializeToString(), "is no absmsg.v1.Reinitialize"),
        (commands.REINITIALIZE, b"\xff\xff", "are no absmsg.v1.Reinitialize"),
        (commands.REINITIALIZE, bytes(1 << 25), "are allowed"),
        (commands.REINITIALIZE, Reinitialize(header=SENDER).SerializeToString(), "belongs to /reinitialize"),
        (commands.REINITIALIZE, Reinitialize(tracker="cloth").SerializeToString(), "belongs to cloth/reinitialize"),
        (commands.REINITIALIZE, Reinitialize(tracker="sheet").SerializeToString(), "it is for rig ''"),
        (
            commands.REINITIALIZE,
            Reinitialize(tracker="sheet", header=Header(boot_id="\x1b[2J")).SerializeToString(),
            r"boot_id = '\x1b[2J' is too long or cannot be printed",
        ),
        (
            commands.REINITIALIZE,
            Reinitialize(tracker="sheet", header=SENDER, seed=Reinitialize.Pixel(row=1 << 14)).SerializeToString(),
            "Pixel.row = 16384 must be in 0 … 16383",
        ),
        (commands.REINITIALIZE, drawn(1 << 14, 1, 1), "Pixel.row = 16384 must be in 0 … 16383"),
        (commands.REINITIALIZE, drawn(1, 2), "a polygon of 2 corners: 3 to 256 are allowed"),
        (commands.REINITIALIZE, drawn(*range(257)), "a polygon of 257 corners: 3 to 256 are allowed"),
        (commands.REINITIALIZE, drawn(1, 2, 3, seed=Reinitialize.Pixel()), "a seed and a polygon: one of them"),
    ],
)
def test_anything_else_is_refused_with_the_reason(message, payload, reason):
    bench = Bench()
    (sample,) = bench.bus.command("sheet/reinitialize", message, payload, 1.0)
    answer = CommandAnswer.FromString(sample.payload)
    assert not answer.accepted
    assert reason in answer.reason
    assert bench.acted == 0
    assert bench.said.counters["commands.refused"] == 1
    assert "\x1b" not in bench.said.labels["command"]


def test_a_mistake_of_ours_is_an_answer_and_a_traceback_of_the_log(caplog):
    bench = Bench()

    def fails():
        raise KeyError("no such name")

    commands.answer_reload(bench.bus, bench.headers, bench.health, fails)
    answer = commands.reload(bench.bus, bench.headers, 1.0)
    assert answer is not None
    assert (answer.accepted, answer.reason) == (False, "KeyError: 'no such name'")
    assert "Traceback" in caplog.text


def test_of_many_commands_the_log_tells_ten_a_second(caplog):
    bench, now_ns = Bench(), 0
    headers = HeaderFactory("demo", WallClock(monotonic=lambda: now_ns))
    commands.answer_reinitialize(bench.bus, "other", headers, bench.health, bench.act)
    for now_ns in range(0, 2_000_000_000, 20_000_000):  # noqa: B007 - the clock reads it
        commands.reinitialize(bench.bus, "other", bench.headers, 1.0)
    assert [record.args[0] for record in caplog.records] == [*range(1, 11), *range(51, 61)]


def test_a_command_crosses_real_sessions(open_bus):
    open_bus()
    bench, asking = Bench(open_bus()), open_bus()
    assert eventually(lambda: commands.reinitialize(asking, "sheet", bench.headers, 1.0) is not None)
    assert asking.query("**", 1.0) == []  # a query without a payload is no command
    assert bench.acted == 1


def test_without_a_tracker_there_is_no_answer():
    assert commands.reinitialize(LoopbackBus(), "sheet", HeaderFactory("demo", WallClock()), 0.1) is None
