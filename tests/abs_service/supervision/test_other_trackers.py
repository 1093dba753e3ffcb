"""A running rig gets other trackers: nothing is left of one that is removed, and the others go on."""

import io
from pathlib import Path

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.display.terminal.lines import PlainDisplay
from abs_service.display.terminal.output import Output
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.run_session import Renewal
from abs_service.tracking.monitors import silence_monitor
from abs_service.wire import commands, estimate_messages
from tests.abs_service.supervision.test_run_session import Bench


def children(tracker):
    """The processes of a rig with the trackers `kept` and this one."""
    names = ("capture", "track/kept", "record", f"track/{tracker}")
    return [Child(name, (), stage) for stage, name in enumerate(names)]


@pytest.fixture
def bench(monkeypatch):
    """A rig with the trackers `old`, which has fallen silent, and `kept`."""
    monkeypatch.setattr(silence_monitor, "SILENCE_NS", 50_000_000)
    bench = Bench(PlainDisplay(Output(io.StringIO().write), Output(io.StringIO().write)), trackers=["old", "kept"])
    bench.supervisor.exchange(children("old"))
    bench.supervisor.poll()
    publisher = bench.bus.publisher(keys.state("old"), estimate_messages.STATE, EVENTS)
    for _ in range(2):
        publisher.put(DeformationState(tracker="old").SerializeToString())
    passes(bench, lambda: level(bench) == Health.LEVEL_ERROR)
    return bench


def level(bench):
    """The level that `run` has published last."""
    reported = [sample.payload for sample in bench.bus.sent if sample.topic == keys.health("run")]
    return Health.FromString(reported[-1]).level if reported else None


def passes(bench, condition):
    """Time, until something is so."""
    end = bench.session.elapsed_s + 20.0
    bench.session.run_until(lambda: condition() or bench.session.elapsed_s > end)
    assert condition()


def test_one_is_added_and_another_one_removed_with_all_that_was_said_of_it(bench):
    process = bench.supervisor.children["track/kept"].process
    renewal = Renewal(Path(), children("new"), ("track/new", "record", "view"), ("track/old",))
    bench.session.answer_reloads(lambda: renewal)
    answer = commands.reload(bench.bus, HeaderFactory("bench", WallClock()), 1.0)
    assert answer is not None
    assert (answer.restarts, answer.ends) == (["track/new", "record"], ["track/old"])
    passes(bench, lambda: "track/new" in bench.supervisor.children)
    last_words = Health(component="track/old", level=Health.LEVEL_ERROR)
    publisher = bench.bus.publisher(keys.health("track/old"), Health.DESCRIPTOR.full_name, EVENTS)
    publisher.put(last_words.SerializeToString())
    passes(bench, lambda: level(bench) == Health.LEVEL_OK)
    view, now = bench.session.view(), bench.supervisor.children
    assert sorted(bench.killed) == ["record", "track/old"]
    assert (list(view.live.trackers), list(view.live.received)) == (["kept", "new"], ["run"])
    assert (now["track/kept"].process, now["track/new"].state) == (process, ChildState.RUNNING)
