"""Numbers of a tracker and its sensors in a table: rates, latency, ages, losses, recording."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.display.page.feed import Feed
from abs_service.display.page.numbers import LOSSES, losses, rate_hz
from abs_service.display.page.readouts import words


def rows(feed: Feed, tracker: str) -> dict[str, str]:
    """Numbers in words, by name."""
    numbers, healths = feed.numbers(tracker), [health for health, _ in feed.healths()]
    skipped = sum(one.skipped for one in numbers)
    found = {"estimates": f"{rate_hz(numbers, feed.now_s):.1f} Hz, {skipped} skipped"}
    if numbers:
        last = numbers[-1]
        latency = f"{last.age_ms:.0f} ms, " if math.isfinite(last.age_ms) else ""  # unknown in a replay
        found["latency"] = f"{latency}search {last.solve_ms:.0f} ms, {last.generations} generations"
    if (newest := feed.newest(keys.state(tracker), DeformationState)) is not None:
        state, since_s = newest
        on_the_way = [one for one in healths if one.component in ("capture", f"track/{tracker}")]
        for sensor in state.sensors:
            parts = _age(state, sensor, since_s), _likelihood(sensor), _losses(on_the_way, sensor.sensor)
            found[sensor.sensor] = ", ".join(filter(None, parts))
    found["lost"] = ", ".join(f"{number} {name}" for name, number in _lost(healths)) or "nothing"
    for health in healths:
        if health.labels.get("file"):
            found["recording"] = health.labels["file"].removesuffix(".active")
        if health.labels.get("trigger"):
            found["recorder"] = health.labels["trigger"]
    return found


def _lost(healths: Iterable[Health]) -> Iterator[tuple[str, int]]:
    """Components that have lost something, and how much."""
    for health in healths:
        if lost := losses(health):
            yield health.component, lost


def _age(state: DeformationState, sensor: DeformationState.Sensor, since_s: float) -> str:
    """Age of the exposure in the last estimate, now, `since_s` after that came [s]."""
    if sensor.missing:
        return "no frame in time"
    older_s = (state.header.t_host_ns - sensor.t_host_ns) * 1e-9
    seconds = state.age_ms * 1e-3 + older_s + since_s
    return f"{words.age(seconds)} old" if math.isfinite(seconds) else ""  # as in a replay


def _likelihood(sensor: DeformationState.Sensor) -> str:
    used = sensor.samples and not sensor.missing
    return f"log-likelihood {sensor.mean_log_likelihood:.2f}" if used else ""


def _losses(healths: Iterable[Health], sensor: str) -> str:
    """Frames of a sensor that are in no estimate, by cause."""
    causes: Counter[str] = Counter()
    for health in healths:
        for name, number in health.counters.items():
            cause, _, topic = name.partition(".")
            if cause in LOSSES and topic.partition("/")[0] == sensor:
                causes[cause] += number
    return ", ".join(f"{number} {cause}" for cause, number in sorted(causes.items()) if number) or "no losses"
