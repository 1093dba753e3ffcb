"""Losses of a run: from sequence numbers of received and recorded messages, and from the components' counters."""

from collections import Counter
from collections.abc import Mapping

from abs_service.bus import keys
from evaluation.service.live import recording
from evaluation.service.live.measurement import ObservedRun
from evaluation.service.live.rig import REFERENCE, STREAMS, TRACKER

#: First words of the names of counters of losses.
_LOST = frozenset({"dropped", "malformed", "missing", "refused", "rejected", "skipped", "unused"})


def exposures(seen: ObservedRun, sensor: str) -> range:
    """Sequence numbers of a sensor's exposures from the first to the last that is in an estimate; empty if none is."""
    used = [one.sensors[sensor] for one in seen.arrivals if sensor in one.sensors]
    return range(used[0], used[-1] + 1) if used else range(0)


def untracked(seen: ObservedRun) -> int:
    """Exposures of the reference between the first and the last estimate watched that are in no estimate."""
    used = {one.sensors[REFERENCE] for one in seen.arrivals if REFERENCE in one.sensors}
    return len(set(exposures(seen, REFERENCE)) - used)


def partial(seen: ObservedRun) -> int:
    """Estimates that lack a sensor."""
    return sum(len(one.sensors) < len({sensor for sensor, _ in STREAMS}) for one in seen.arrivals)


def not_received(seen: ObservedRun) -> int:
    """Estimates that were published and did not arrive."""
    seqs = [one.seq for one in seen.arrivals]
    return recording.count_missing(seqs, seqs[0], seqs[-1])


def unrecorded(seen: ObservedRun) -> Mapping[str, int]:
    """Messages between the first and the last estimate watched that are not in the recording, by topic."""
    first, last = seen.arrivals[0], seen.arrivals[-1]
    missing = {keys.state(TRACKER): recording.count_missing(seen.recorded[keys.state(TRACKER)], first.seq, last.seq)}
    for sensor, stream in STREAMS:
        topic = keys.image(sensor, stream)
        missing[topic] = len(set(exposures(seen, sensor)) - seen.recorded[topic])
    return missing


def loss_counters(counts: Mapping[str, Mapping[str, int]]) -> Counter[str]:
    """Counters of losses as `component: what.why`; zeros are left out.

    Args:
        counts: counters by component and name.
    """
    found = Counter(
        {f"{component}: {name}": number for component, names in counts.items() for name, number in names.items()}
    )
    return Counter({name: number for name, number in found.items() if number and _is_loss(name.partition(": ")[2])})


def _is_loss(counter: str) -> bool:
    """True if a counter counts losses; a device's counters do, except those of delivered and unwanted frames."""
    words = counter.split(".")
    return words[0] in _LOST or (words[0] == "device" and words[-1] not in {"frames", "unwanted"})
