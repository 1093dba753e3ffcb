"""The recorded frames through one process, as the tracker's process takes them: from images to bytes of estimates."""

import hashlib
import time
from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from abs_service import wiring
from abs_service.bus import keys
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts import recorded_rig
from abs_service.commands.recordings import replay
from abs_service.tracker.estimates.estimate import Estimate, Status
from abs_service.tracking.session import TrackingSession
from abs_service.wire import estimate_messages
from abs_service.wire.estimate_messages import Effort, Identity
from drivers.contract.frame import Frame, FrameSet
from drivers.replay import Recording
from evaluation.service.frame_budget.errors import TrackedFrame
from evaluation.service.frame_budget.rig import TRACKER
from evaluation.service.frame_budget.stages import COPY, ENCODE, READ, SEAMS
from evaluation.service.frame_budget.stopwatch import Stopwatch

#: Frames at the beginning that are not counted: the first contains the initial detection, and kernels are loaded.
FIRST = 5


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass through a recording.

    Attributes:
        frame_ms: time of every counted frame (n,), beginning with the pairing of its first image [ms].
        cpu_ms: CPU time of every stage (n,) [ms], by name; empty if the stages were not watched.
        tracking: share of the frames that are TRACKING.
        thetas: hash of Θ of all frames.
        frames: estimates by exposure of the first depth image.
    """

    frame_ms: NDArray[np.float64]
    cpu_ms: dict[str, NDArray[np.float64]]
    tracking: float
    thetas: str
    frames: Mapping[int, TrackedFrame]


def run_through(take: Path, is_watched: bool) -> Pass:
    """Tracks all frames of a recording.

    Args:
        take: the recording.
        is_watched: whether the stages are timed, which takes time itself.
    """
    recording = Recording(take)
    settings = replay.configuration(recording, None)
    rig, synchroniser = recorded_rig.recorded_rig(settings, TRACKER, recording)
    clock = WallClock(lambda: 0, lambda: recording.wall_offset_ns)
    watch, headers = Stopwatch(), HeaderFactory(settings.name, clock)
    process = _Process(TrackingSession(rig, wiring.plan(settings, TRACKER)), headers, watch)
    frames = _frames(recording, watch)
    with watch.watching(SEAMS) if is_watched else nullcontext():
        for frame in frames:
            begin_ns = time.monotonic_ns()
            for frame_set in synchroniser.add(frame):
                process.take(frame_set, begin_ns)
                with watch.stage(COPY):
                    _copy(frame_set)
                watch.lap()
    return Pass(
        np.array(process.took_ns[FIRST:]) * 1e-6,
        _by_stage(watch) if is_watched else {},
        process.tracked / len(process.took_ns),
        process.thetas.hexdigest(),
        process.frames,
    )


class _Process:
    """Work of a tracker's process on a frame set."""

    def __init__(self, session: TrackingSession, headers: HeaderFactory, watch: Stopwatch):
        self.took_ns: list[int] = []
        self.tracked = 0
        self.thetas = hashlib.sha256()
        self.frames: dict[int, TrackedFrame] = {}
        self._session = session
        self._headers = headers
        self._watch = watch
        self._version, self._made = -1, 0
        self._identity = Identity(TRACKER, "nurbs", "", "", 1)

    def take(self, frames: FrameSet, begin_ns: int) -> None:
        estimate = self._session.track(frames, lambda: True)
        header = self._headers.at(estimate.t_host_ns, estimate.seq, keys.RIG_FRAME)
        with self._watch.stage(ENCODE):
            estimate_messages.state(header, estimate, self._identity, Effort(0, 0, 0, 0, 0, {})).SerializeToString()
            estimate_messages.mesh(header, estimate, self._identity).SerializeToString()
        self.took_ns.append(time.monotonic_ns() - begin_ns)
        self.tracked += estimate.status == Status.TRACKING
        self._keep(next(frame.seq for frame in frames.frames.values() if frame.stream == "depth"), estimate)
        self.thetas.update(np.ascontiguousarray(estimate.theta).tobytes())

    def _keep(self, k: int, estimate: Estimate) -> None:
        if self._session.mesh is None:
            return
        if self._session.mesh_version != self._version:
            self._version, self._made = self._session.mesh_version, k
        is_tracking, rest = estimate.status == Status.TRACKING, self._session.mesh.vertices
        self.frames[k] = TrackedFrame(is_tracking, estimate.vertices, rest, self._made)


def _frames(recording: Recording, watch: Stopwatch) -> Iterator[Frame]:
    items = recording.frames()
    while True:
        with watch.stage(READ):
            item = next(items, None)
        if item is None:
            return
        if isinstance(item, Frame):
            yield item


def _copy(frames: FrameSet) -> None:
    """The reference: what it takes to touch every byte once."""
    for frame in frames.frames.values():
        frame.data.copy()


def _by_stage(watch: Stopwatch) -> dict[str, NDArray[np.float64]]:
    laps = watch.laps[FIRST:]
    names = dict.fromkeys(name for lap in laps for name in lap)
    return {name: np.array([lap.get(name, 0) for lap in laps]) * 1e-6 for name in names}
