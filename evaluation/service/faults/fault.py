"""A fault, what is promised of it, and what was seen when it was made."""

import itertools
import math
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from absmsg.v1.health_pb2 import Health

from abs_service.supervision.supervisor import WORKED_NS
from evaluation.service.faults.running import RunningRig, start_run

#: All faults are to be visible in health within this time [s].
NOTICED_S = 2.0


@dataclass(frozen=True, slots=True)
class Made:
    """A fault that was made.

    Attributes:
        begin_ns: when it began, CLOCK_MONOTONIC [ns].
        end_ns: when its cause was gone [ns].
        broken: a further promise that was not kept, in words; "" if none.
    """

    begin_ns: int
    end_ns: int
    broken: str = ""


@dataclass(frozen=True)
class Fault:
    """A fault and what is promised of it.

    Attributes:
        name: what happens.
        promise: in words; the bounds that follow are part of it.
        make: makes it, once.
        estimates_s: longest time between two exposures with an estimate that says TRACKING [s].
        recording_s: longest time between two recorded depth images [s].
        noticed_s: time until a component's health is not OK [s]; infinite where nothing has to be said.
        tracks_s: time from the end of the cause to the first estimate that says TRACKING [s].
        restarted: processes that may be others afterwards.
        device: added to the address of the simulated device.
        room_mb: size of a file system of its own for the recordings [MB]; 0 for none.
        start: starts the processes.
    """

    name: str
    promise: str
    make: Callable[[RunningRig], Made]
    estimates_s: float = 0.5
    recording_s: float = 0.5
    noticed_s: float = NOTICED_S
    tracks_s: float = math.inf
    restarted: frozenset[str] = frozenset()
    device: str = ""
    room_mb: int = 0
    start: Callable[[Path, str, int], AbstractContextManager[RunningRig]] = start_run


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """A fault that cannot be made on a machine that others use.

    Attributes:
        name, promise: as of a `Fault`.
        test: the tests that have it, with simulated disks, clocks or devices.
    """

    name: str
    promise: str
    test: str


@dataclass(frozen=True, slots=True)
class Try:
    """Measurements of one try. NaN: it did not happen.

    Attributes:
        noticed_s: from the beginning to the first health that is not OK [s].
        said: that health's message.
        recovered_s: from the end of the cause until it tracks and every component's health is OK again [s].
        estimates_s, recording_s, tracks_s: see `Fault`.
        broken: a promise that was not kept besides, in words.
    """

    noticed_s: float
    said: str
    recovered_s: float
    estimates_s: float
    recording_s: float
    tracks_s: float
    broken: str

    def missed(self, fault: Fault) -> str:
        """The promises that were not kept, in words; "" if all were."""
        found = [self.broken] if self.broken else []
        if math.isnan(self.recovered_s):
            found.append("did not recover")
        if not math.isinf(fault.noticed_s) and not self.noticed_s <= fault.noticed_s:
            found.append("not in health" if math.isnan(self.noticed_s) else f"in health after {self.noticed_s:.1f} s")
        if not self.tracks_s <= fault.tracks_s:
            found.append(f"tracks after {self.tracks_s:.1f} s")
        if not self.estimates_s <= fault.estimates_s:
            found.append(f"no estimate for {self.estimates_s:.1f} s")
        if not self.recording_s <= fault.recording_s:
            found.append(f"no recording for {self.recording_s:.1f} s")
        return ", ".join(found)


@dataclass(frozen=True, slots=True)
class Seen:
    """One try before the recording is read: the fault, and the time in which all was well again [ns]."""

    made: Made
    calm_ns: int
    recovered: bool


#: Longest time that a rig may take to recover [s]; a try ends there.
PATIENCE_S = 30.0


def make_tries(fault: Fault, tries: int, folder: Path, progress: Callable[[str], None]) -> list[Try]:
    """Starts a rig in an empty folder, makes the fault again and again, and reads what was recorded.

    Raises:
        UnavailableError: this machine does not permit it; says what was refused.
    """
    seen: list[Seen] = []
    with fault.start(folder, fault.device, fault.room_mb) as rig:
        for number in range(tries):
            progress(f"{fault.name}, {number + 1} of {tries}")
            if number and fault.restarted:
                time.sleep(WORKED_NS * 1e-9)  # the supervisor waits for one that fails sooner, longer each time
            rig.await_calm(PATIENCE_S)
            seen.append(make_once(fault, rig))
        times_ns = rig.on_own_clock(rig.recorded_stamps())
        return [judge(one, rig, times_ns) for one in seen]


def make_once(fault: Fault, rig: RunningRig) -> Seen:
    """Makes a fault and waits until all is well again."""
    before = rig.processes()
    made = fault.make(rig)
    recovered = rig.await_calm(PATIENCE_S, since_ns=made.end_ns, required=False)
    after = rig.processes()
    others = sorted(name for name in before if before[name] != after.get(name) and name not in fault.restarted)
    broken = ", ".join([*filter(None, [made.broken]), *(f"{name} was restarted" for name in others)])
    return Seen(Made(made.begin_ns, made.end_ns, broken), rig.now_ns(), recovered)


def judge(seen: Seen, rig: RunningRig, recorded_ns: Sequence[int]) -> Try:
    """Measurements of a try; `recorded_ns` has the times of all recorded images, CLOCK_MONOTONIC [ns]."""
    made, listener = seen.made, rig.listener
    said = [(t_ns, one) for t_ns, one in listener.health if made.begin_ns <= t_ns <= seen.calm_ns]
    bad = [(t_ns, one) for t_ns, one in said if one.level > Health.LEVEL_OK]
    exposed_ns = [exposed for _, exposed, tracking in listener.states if tracking]
    tracks_ns = next((t for t, exposed, tracking in listener.states if tracking and exposed > made.end_ns), math.nan)
    back_ns = max(tracks_ns, _all_ok_ns(said))
    return Try(
        noticed_s=(bad[0][0] - made.begin_ns) * 1e-9 if bad else math.nan,
        said=f"{bad[0][1].component}: {bad[0][1].message}" if bad else "",
        recovered_s=(back_ns - made.end_ns) * 1e-9 if seen.recovered else math.nan,
        estimates_s=gap_s(exposed_ns, made.begin_ns, seen.calm_ns),
        recording_s=gap_s(recorded_ns, made.begin_ns, seen.calm_ns),
        tracks_s=(tracks_ns - made.end_ns) * 1e-9,
        broken=made.broken,
    )


def _all_ok_ns(said: Sequence[tuple[int, Health]]) -> float:
    """Time at which the last component recovered to OK [ns]; 0 if all were OK."""
    latest_ns = 0
    for component in {one.component for _, one in said}:
        levels = [(t_ns, one.level) for t_ns, one in said if one.component == component]
        for (_, before), (t_ns, level) in itertools.pairwise(levels):
            if before != Health.LEVEL_OK and level == Health.LEVEL_OK:
                latest_ns = max(latest_ns, t_ns)
    return latest_ns


def gap_s(times_ns: Sequence[int], begin_ns: int, end_ns: int) -> float:
    """Longest time without any of `times_ns` that begins or ends between two moments [s]; infinite without any."""
    times = sorted(times_ns)
    before = [t for t in times if t < begin_ns][-1:]
    after = [t for t in times if t > end_ns][:1]
    inside = [t for t in times if begin_ns <= t <= end_ns]
    chosen = [*before, *inside, *after]
    return max((b - a for a, b in itertools.pairwise(chosen)), default=math.inf) * 1e-9
