"""Status of a rig in words: of the tracker that is shown, of the others, and of every component with a warning."""

from collections.abc import Iterator
from dataclasses import replace

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.display.page.feed import Feed
from abs_service.display.page.numbers import rate_hz
from abs_service.display.page.readouts import words
from abs_service.display.page.readouts.words import STALE_S, STATUS, StatusLine

#: Time after a tracker's first estimate from which its rate is judged [s].
JUDGED_AFTER_S = 1.0
#: Begin of the message of a tracker's health where that is its status.
_STATUSES = tuple(f"{name}: " for name in STATUS)


def lines(feed: Feed, tracker: str, silence: str) -> list[StatusLine]:
    """Messages for the user, the most important first.

    Args:
        feed: of the rig.
        tracker: that is shown.
        silence: what to do while nothing is received from the rig.
    """
    silent = words.silence(feed.age_s(), silence)
    if silent is not None:
        return [silent]
    known, preparing = feed.trackers(), _preparing(feed)
    trackers = [*(() if preparing and not known else [tracker]), *(other for other in known if other != tracker)]
    found = {name: _tracker(feed, name) for name in trackers}
    found |= {name: words.preparing(kernels) for name, kernels in preparing.items() if name not in found}
    titled = [replace(one, title=f"{name}: {one.title}") if len(found) > 1 else one for name, one in found.items()]
    return [*titled, *_warnings(feed)]


def _preparing(feed: Feed) -> dict[str, str]:
    """Progress of the compilation by tracker, of those that compile or load their kernels."""
    fresh = (health for health, age_s in feed.healths() if age_s < 3 * STALE_S and _tracked(health.component))
    return {
        _tracked(health.component): health.labels.get("kernels", "")
        for health in fresh
        if health.labels.get("phase") == "preparing"
    }


def _tracker(feed: Feed, tracker: str) -> StatusLine:
    newest = feed.newest(keys.state(tracker), DeformationState)
    if newest is None:
        return words.tracker("", [], [], float("inf"), float("nan"))
    state, age_s = newest
    return words.tracker(
        _name(state), state.reasons, state.warnings, age_s, 1e3 * state.deviation_m, _slow(feed, tracker)
    )


def _slow(feed: Feed, tracker: str) -> str:
    numbers = feed.numbers(tracker)
    if not numbers or feed.now_s - numbers[0].t_s < JUDGED_AFTER_S:
        return ""
    depth = [topic for topic in feed.streams() if topic.endswith("/depth/image")]
    camera_hz = max((feed.image_rate_hz(topic) for topic in depth), default=0.0)
    return words.slow(rate_hz(numbers, feed.now_s), camera_hz, sum(one.skipped for one in numbers))


def _warnings(feed: Feed) -> Iterator[StatusLine]:
    """Components that report a warning or an error, without those that the estimates contain already, or contradict."""
    for health, age_s in feed.healths():
        message = _unsaid(feed, health)
        if age_s < 3 * STALE_S and health.level >= Health.LEVEL_WARNING and (message or not health.message):
            color = STATUS["LOST" if health.level == Health.LEVEL_ERROR else "DEGRADED"][1]
            yield StatusLine(health.component, message, color)


def _unsaid(feed: Feed, health: Health) -> str:
    """The message of a component, without the status of a tracker, and without the silence of one that estimates.

    Health comes once a second: by then an estimate may say something else.
    """
    newest = feed.newest(keys.state(_tracked(health.component)), DeformationState)
    if newest is not None:
        titled = health.message.startswith(_STATUSES) or health.message == "; ".join(newest[0].warnings)
        return "" if titled else health.message
    if health.component != "run":
        return health.message
    estimating = tuple(f"track/{name}" for name in feed.trackers() if _is_fresh(feed, name))
    return "; ".join(part for part in health.message.split("; ") if not part.startswith(estimating))


def _is_fresh(feed: Feed, tracker: str) -> bool:
    newest = feed.newest(keys.state(tracker), DeformationState)
    return newest is not None and newest[1] <= STALE_S


def _tracked(component: str) -> str:
    """The tracker whose process a component is; "" if it is none."""
    return component.removeprefix("track/") if component.startswith("track/") else ""


def _name(state: DeformationState) -> str:
    return DeformationState.Status.Name(state.status).removeprefix("STATUS_")
