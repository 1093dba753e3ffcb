"""Links to the pages of other rigs say how those are."""

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState

from abs_service.bus import keys
from abs_service.bus.contract import STATE
from abs_service.display.page.feed import Feed
from abs_service.display.page.readouts import words
from abs_service.display.page.readouts.neighbours import Neighbour, links
from tests.abs_service.bus.loopback import LoopbackBus


def link(name="lab", **statuses):
    bus = LoopbackBus()
    feed = Feed(bus, lambda: 0)
    for tracker, status in statuses.items():
        state = DeformationState(tracker=tracker, status=f"STATUS_{status}", deviation_m=0.0004)
        bus.publisher(keys.state(tracker), state.DESCRIPTOR.full_name, STATE).put(state.SerializeToString())
    return links([Neighbour(name, "http://127.0.0.1:8081", feed, "Start it.")])


@pytest.mark.parametrize(
    ("statuses", "text", "color"),
    [
        ({"sheet": "TRACKING"}, "lab: Tracking, σ 0.40 mm<", words.STATUS["TRACKING"][1]),
        (
            {"left": "TRACKING", "right": "LOST"},
            "lab: left: Tracking, σ 0.40 mm, right: Object lost<",
            words.STATUS["LOST"][1],
        ),
        ({}, "lab: Nothing received from the rig yet<", words.STALE_COLOR),
    ],
)
def test_a_link_has_the_words_and_the_worst_colour_of_its_rig(statuses, text, color):
    html = link(**statuses)
    assert "href='http://127.0.0.1:8081' target='_blank'" in html
    assert text in html
    assert f"background:{color}" in html


def test_names_are_no_html():
    assert "<b>" not in link(name="<b>")


def test_without_other_rigs_there_are_no_links():
    assert links([]) == ""
