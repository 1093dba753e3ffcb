"""`abs-service trigger` asks the recorder, and says what it answers."""

import pytest

from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.running import trigger
from abs_service.wire import commands
from tests.abs_service.bus.loopback import LoopbackBus


@pytest.mark.parametrize(
    ("recording", "refusal", "code", "words"),
    [
        (True, "", 0, "the recorder records"),
        (False, "", 0, "the recorder waits"),
        (True, "it is busy", 1, "the recorder refuses: it is busy"),
    ],
)
def test_the_answer_is_told(capsys, recording, refusal, code, words):
    bus, headers, asked = LoopbackBus(), HeaderFactory("demo", WallClock()), []
    commands.answer_record(bus, headers, Health(bus, "record", headers), lambda wanted: asked.append(wanted) or refusal)
    assert trigger.request(bus, headers, recording) == code
    assert capsys.readouterr().out == f"{words}\n"
    assert asked == [recording]


def test_a_recorder_that_gives_no_answer_is_said(capsys):
    assert trigger.request(LoopbackBus(), HeaderFactory("demo", WallClock()), True) == 1
    assert "it gives no answer; does it run?" in capsys.readouterr().out
