"""The page starts and ends recordings, and says what the recorder answers."""

import pytest
from absmsg.v1.sensor_model_pb2 import Config

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.display.page.acting import recording
from abs_service.display.page.feed import Feed
from abs_service.recording.triggers.trigger import ALWAYS, RequestTrigger
from abs_service.wire import commands
from tests.abs_service.bus.loopback import LoopbackBus


class Bench:
    """A page and, beside it, a recorder with a trigger."""

    def __init__(self, trigger=None):
        self.bus, self.headers = LoopbackBus(), HeaderFactory("demo", WallClock())
        if trigger is not None:
            commands.answer_record(self.bus, self.headers, Health(self.bus, "record", self.headers), trigger.ask)

    def ask(self, wanted: bool) -> str:
        return recording.ask(lambda on: commands.record(self.bus, self.headers, on, 1.0), wanted)


def test_a_recorder_with_a_trigger_begins_and_ends():
    trigger = RequestTrigger(watches_status=False, post_roll_s=1.0, clock=lambda: 0)
    bench = Bench(trigger)
    assert bench.ask(True) == "The recorder records."
    assert trigger.reason == "asked for"
    assert bench.ask(False) == "The recorder waits for the next trigger."
    assert trigger.reason == ""


@pytest.mark.parametrize("wanted", [True, False])
def test_a_recorder_that_records_always_says_so(wanted):
    assert Bench(ALWAYS).ask(wanted) == ('The recorder refuses: record.when = "always": it records as long as it runs.')


@pytest.mark.parametrize(
    ("toml", "said"),
    [
        ('[record]\nwhen = "always"', 'record.when = "always"'),
        ("", 'With `"requested"`'),
        ('[record]\nwhen = "requested"', ""),
        ("record = 3", ""),
        ("[", ""),
    ],
)
def test_recording_is_offered_where_the_recorder_takes_commands(toml, said):
    bench = Bench(ALWAYS)
    feed = Feed(bench.bus, lambda: 0)
    assert "No recorder runs" in recording.unavailable(feed)
    Health(bench.bus, "record", bench.headers).publish()
    assert recording.unavailable(feed) == ""
    bench.bus.publisher(keys.CONFIG, Config.DESCRIPTOR.full_name, EVENTS).put(Config(toml=toml).SerializeToString())
    reason = recording.unavailable(feed)
    assert (said in reason) if said else not reason


def test_without_a_recorder_there_is_no_answer():
    assert "gives no answer" in Bench().ask(True)
