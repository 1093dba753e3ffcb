"""Status of a rig in words: of the tracker that is shown, of the others, and of every component with a warning."""

from collections.abc import Iterator
from dataclasses import replace

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.display.page.feed import Feed, rate_hz
from abs_service.display.page.readouts import words
from abs_service.display.page.readouts.words import STALE_S, STATUS, Words


def lines(feed: Feed, tracker: str, silence: str) -> list[Words]:
    """All that there is to say, the most important first.

    Args:
        feed: of the rig.
        tracker: that is shown.
        silence: what to do while nothing is heard of the rig.
    """
    silent = words.silence(feed.age_s(), silence)
    if silent is not None:
        return [silent]
    trackers = [tracker, *(other for other in feed.trackers() if other != tracker)]
    found = [_tracker(feed, name) for name in trackers]
    if len(trackers) > 1:
        found = [replace(one, title=f"{name}: {one.title}") for name, one in zip(trackers, found)]
    return [*found, *_slow(feed, tracker), *_warnings(feed)]


def _tracker(feed: Feed, tracker: str) -> Words:
    newest = feed.newest(keys.state(tracker), DeformationState)
    state, age_s = newest if newest else (DeformationState(), float("inf"))
    name = _name(state) if newest else ""
    return words.tracker(name, state.reasons, state.warnings, age_s, 1e3 * state.deviation_m)


def _slow(feed: Feed, tracker: str) -> Iterator[Words]:
    newest, numbers = feed.newest(keys.state(tracker), DeformationState), feed.numbers(tracker)
    if newest is None or newest[1] > STALE_S:
        return
    depth = [topic for topic in feed.streams() if topic.endswith("/depth/image")]
    camera_hz = max((feed.image_rate_hz(topic) for topic in depth), default=0.0)
    slow = words.slow(rate_hz(numbers, feed.now_s), camera_hz, sum(one.skipped for one in numbers))
    if slow:
        yield Words("The tracker is slow", slow, STATUS["DEGRADED"][1])


def _warnings(feed: Feed) -> Iterator[Words]:
    """Components that report a warning or an error, but for what the status of a tracker says already."""
    for health, age_s in feed.healths():
        newest = feed.newest(keys.state(health.component.removeprefix("track/")), DeformationState)
        said = newest is not None and health.message.startswith(_name(newest[0]))
        if age_s < 3 * STALE_S and health.level >= Health.LEVEL_WARNING and not said:
            color = STATUS["LOST" if health.level == Health.LEVEL_ERROR else "DEGRADED"][1]
            yield Words(health.component, health.message, color)


def _name(state: DeformationState) -> str:
    return DeformationState.Status.Name(state.status).removeprefix("STATUS_")
