"""Offline tracking of a recording: every frame set, no clock, deterministic."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain, count
from pathlib import Path
from typing import Any

from abs_service.bus import keys
from abs_service.bus.stamps import HeaderFactory
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.estimates.estimate import Estimate
from abs_service.tracking.log.tracker_log import EstimateReport, TrackerLog
from abs_service.tracking.session import TrackingSession
from abs_service.tracking.tracked_sets import track_sets
from abs_service.wire import estimate_messages
from abs_service.wire.estimate_messages import Effort, Identity
from drivers.contract.device import Truth
from drivers.contract.frame import Frame, FrameSet
from drivers.encoding.mcap_file import McapFile
from drivers.replay import Recording

#: Offline there is no exposure to be late for.
NO_AGE = float("nan")
#: And no time that the search must not exceed.
NO_BUDGET_MS = 0.0


class OfflineTracker:
    """One tracker that takes every frame set, writes its estimates to a file and reports them.

    Args:
        name: of the tracker.
        session: the tracker.
        synchroniser: makes its frame sets.
        model: type of its deformation model.
        calib_id: hash of its rig's calibration.
        headers: writes the headers.
        file: takes the messages.
        clock: measures the time of a search [ns]; nothing depends on it.
    """

    def __init__(
        self,
        name: str,
        session: TrackingSession,
        synchroniser: Synchroniser,
        model: str,
        calib_id: str,
        headers: HeaderFactory,
        file: McapFile,
        clock: Callable[[], int],
    ):
        self.log = TrackerLog()
        self.synchroniser = synchroniser
        self._name = name
        self._session = session
        self._identity = Identity(name, model, "", calib_id, 0)
        self._headers = headers
        self._file = file
        self._clock = clock

    def add_truth(self, truth: Truth) -> None:
        """Adds ground truth of a simulated device."""
        self.log.truth.add_truth(truth.t_host_ns, truth.points_r, truth.surface)

    def add_frame(self, frame: Frame) -> Iterator[EstimateReport]:
        """Adds a frame; yields the estimates of the frame sets that it completes."""
        return self._track(self.synchroniser.add(frame))

    def finish(self) -> Iterator[EstimateReport]:
        """Yields the estimates of the remaining frame sets."""
        return self._track(self.synchroniser.flush())

    def _track(self, frame_sets: Iterable[FrameSet]) -> Iterator[EstimateReport]:
        for _, estimate, took_ns in track_sets(self._session, frame_sets, self._clock):
            yield from self._report(estimate, took_ns * 1e-6)

    def _report(self, estimate: Estimate, solve_ms: float) -> Iterator[EstimateReport]:
        self._write_new_topology()
        header = self._headers.at(estimate.t_host_ns, estimate.seq, keys.RIG_FRAME)
        state = estimate_messages.state(
            header, estimate, self._identity, Effort(solve_ms, NO_BUDGET_MS, NO_AGE, NO_AGE, 0, {})
        )
        mesh = estimate_messages.mesh(header, estimate, self._identity)
        self._write(keys.state(self._name), estimate_messages.STATE, state, estimate)
        self._write(keys.mesh(self._name), estimate_messages.MESH, mesh, estimate)
        yield from self.log.take_state(state)
        yield from self.log.take_mesh(mesh)

    def _write_new_topology(self) -> None:
        mesh, version = self._session.mesh, self._session.mesh_version
        if mesh is None or version == self._identity.mesh_version:
            return
        self._identity = estimate_messages.with_mesh(self._identity, mesh, version, self._session.derived)
        header = self._headers.at(self._session.made_ns, version, keys.RIG_FRAME)
        topology = estimate_messages.topology(header, mesh, self._identity)
        topic = f"/{keys.topology(self._name)}"
        wall_ns = self._headers.clock.wall(self._session.made_ns)
        self._file.write(topic, estimate_messages.TOPOLOGY, topology.SerializeToString(), wall_ns, version)
        self.log.truth.add_topology(mesh.vertices, self._session.made_ns)

    def _write(self, topic: str, message: str, content: Any, estimate: Estimate) -> None:
        wall_ns = self._headers.clock.wall(estimate.t_host_ns)
        self._file.write(f"/{topic}", message, content.SerializeToString(), wall_ns, estimate.seq)


def replay(recording: Recording, trackers: Mapping[str, OfflineTracker]) -> Iterator[tuple[str, EstimateReport | None]]:
    """Runs a recording through the trackers.

    Yields:
        For every frame that was read, its stream's topic and no report; for every estimate, its tracker and the report.
    """
    for item in recording.frames():
        if isinstance(item, Truth):
            for tracker in trackers.values():
                tracker.add_truth(item)
            continue
        yield keys.image(item.sensor, item.stream), None
        for name, tracker in trackers.items():
            for report in tracker.add_frame(item):
                yield name, report
    for name, tracker in trackers.items():
        for report in tracker.finish():
            yield name, report


def free_path(recording: Path) -> Path:
    """A file beside the recording that does not exist, nor unfinished: `x_replay.mcap`, `x_replay_2.mcap`, …."""
    suffixes = chain(["_replay"], (f"_replay_{number}" for number in count(2)))
    paths = (recording.with_name(f"{recording.stem}{suffix}.mcap") for suffix in suffixes)
    return next(path for path in paths if not (path.exists() or path.with_name(f"{path.name}.active").exists()))
