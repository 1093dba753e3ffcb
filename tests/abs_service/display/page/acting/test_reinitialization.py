"""The page asks for a detection, and says what comes of it."""

import pytest
from absmsg.v1.command_pb2 import CommandAnswer
from absmsg.v1.deformation_state_pb2 import DeformationState

from abs_service.bus import keys
from abs_service.bus.contract import STATE
from abs_service.display.page.acting.reinitialization import ANSWER_S, Reinitialization
from abs_service.display.page.feed import Feed
from abs_service.wire.commands import Choice
from tests.abs_service.bus.loopback import LoopbackBus

SEED = Choice(seed=(111, 133))
REGION = '[trackers.sheet.region]\ntype = "seed"\npixel = [111, 133]\n'


class Bench:
    """A page of a rig whose tracker gives one answer."""

    def __init__(self, answer: CommandAnswer | None):
        self.now_ns, self.asked, self.said = 0, [], []
        bus = LoopbackBus()
        feed = Feed(bus, lambda: self.now_ns)
        self._states = bus.publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
        self.publish(1)

        def send(*asked):
            self.asked.append(asked)
            return answer

        self.page = Reinitialization(feed, send, self.said.append)

    def publish(self, version: int) -> None:
        self._states.put(DeformationState(tracker="sheet", mesh_version=version).SerializeToString())


def test_a_chosen_pixel_is_sent_and_the_lines_that_keep_it_are_offered():
    bench = Bench(CommandAnswer(accepted=True, region=REGION))
    bench.page.ask("sheet", SEED)
    assert bench.asked == [("sheet", SEED)]
    bench.page.look()
    assert bench.said == ["Asks the tracker to detect its object again at pixel [111, 133] …"]
    bench.publish(2)
    bench.page.look()
    mesh, offer = bench.said[-1].split("\n\n", 1)
    assert mesh == "New mesh, version 2."
    assert offer == f"To keep this choice, write into the rig file, in place of its region:\n```toml\n{REGION}```"
    bench.page.look()
    assert len(bench.said) == 2


def test_without_a_pixel_there_is_nothing_to_keep():
    bench = Bench(CommandAnswer(accepted=True))
    bench.page.ask("sheet")
    bench.publish(2)
    bench.page.look()
    assert bench.said[-1] == "New mesh, version 2."


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "The tracker refuses: it gives no answer."),
        (CommandAnswer(reason="the pixel is outside"), "The tracker refuses: the pixel is outside."),
    ],
)
def test_a_refusal_is_told_at_once(answer, words):
    bench = Bench(answer)
    bench.page.ask("sheet", SEED)
    bench.publish(2)
    bench.page.look()
    assert bench.said[-1] == words


def test_when_no_object_was_found_that_is_told():
    bench = Bench(CommandAnswer(accepted=True, region=REGION))
    bench.page.ask("sheet", SEED)
    bench.now_ns = round((ANSWER_S + 1) * 1e9)
    bench.page.look()
    assert "No object was found" in bench.said[-1]
