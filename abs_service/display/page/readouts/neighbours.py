"""Other rigs that the same command shows: a link to the page of each, with its state in words and in colour."""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape

from abs_service.display.page.feed import Feed
from abs_service.display.page.readouts import status, words

#: Colours of a state, the worst first.
_WORST = (*(words.STATUS[name][1] for name in ("LOST", "DEGRADED")), words.STALE_COLOR, words.STATUS["INITIALIZING"][1])


@dataclass(frozen=True, slots=True)
class Neighbour:
    """Another rig: its name, the address of its page, its messages, and advice while it publishes none."""

    name: str
    url: str
    feed: Feed
    silence: str


def links(neighbours: Iterable[Neighbour]) -> str:
    """HTML with a link for each."""
    return "".join(map(_link, neighbours))


def _link(one: Neighbour) -> str:
    trackers = one.feed.trackers()
    lines = status.lines(one.feed, trackers[0] if trackers else "", one.silence)
    color = next((color for color in _WORST if any(line.color == color for line in lines)), lines[0].color)
    text = escape(f"{one.name}: {', '.join(line.title for line in lines)}")
    style = f"display:block;background:{color};color:white;padding:4px 12px;border-radius:6px;margin:6px 8px"
    return f"<a href='{one.url}' target='_blank' style='{style}'>{text}</a>"
