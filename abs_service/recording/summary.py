"""Summary of a recording: rates, gaps and losses of its images, status of its estimates, bytes of its topics."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import SensorModel
from mcap.records import Message

from drivers.encoding.parsing import CodecError, parse_message
from drivers.replay.contents import DAMAGE, Contents, RecordingError, read_chunk, scan

#: A gap is a break between two messages of at least so many of the topic's median period.
GAP_PERIODS = 2.5

#: First words of the counters of health that count losses.
LOSSES = ("dropped", "lost", "malformed", "refused", "skipped", "unused")

_INFO, _STATE, _HEALTH, _MODEL = (
    kind.DESCRIPTOR.full_name for kind in (FrameInfo, DeformationState, Health, SensorModel)
)


@dataclass
class Topic:
    """Messages of one topic.

    Attributes:
        schema: full name of the messages.
        size_bytes: of their content, before the compression of the file.
        times_ns: log times, in file order.
        lost: exposures missing in the sequence numbers; of descriptions of images.
        reconnects: epochs that began after the first; of these, too.
    """

    schema: str
    size_bytes: int = 0
    times_ns: list[int] = field(default_factory=list)
    lost: int = 0
    reconnects: int = 0

    @property
    def rate_hz(self) -> float:
        """Reciprocal of the median time between two messages [Hz]; NaN for fewer than two messages."""
        period_s = self._period_s()
        return 1.0 / period_s if period_s > 0 else float("nan")

    @property
    def gaps_s(self) -> list[float]:
        """Times between two messages that are much longer than the median [s], see `GAP_PERIODS`."""
        period_s = self._period_s()
        return [gap_s for gap_s in self._steps_s().tolist() if period_s > 0 and gap_s > GAP_PERIODS * period_s]

    def _period_s(self) -> float:
        steps_s = self._steps_s()
        return float(np.median(steps_s)) if len(steps_s) else float("nan")

    def _steps_s(self) -> np.ndarray:
        return np.diff(np.sort(np.array(self.times_ns, np.int64))) * 1e-9


@dataclass
class Track:
    """Estimates of one tracker.

    Attributes:
        statuses: number of estimates by status.
        deviations_m: standard deviation of a vertex's position, of every estimate that has an object [m].
        solve_ms: duration of every search [ms].
        skipped: frame sets passed over for newer ones.
        meshes: versions of the mesh.
        untracked_s: longest time without TRACKING [s].
    """

    statuses: Counter[str] = field(default_factory=Counter)
    deviations_m: list[float] = field(default_factory=list)
    solve_ms: list[float] = field(default_factory=list)
    skipped: int = 0
    meshes: set[int] = field(default_factory=set)
    untracked_s: float = 0.0
    _tracked_ns: int | None = None

    def add(self, state: DeformationState, t_ns: int) -> None:
        """Takes an estimate that was logged at `t_ns`."""
        status = DeformationState.Status.Name(state.status).removeprefix("STATUS_")
        self.statuses[status] += 1
        self.solve_ms.append(state.solve_ms)
        self.skipped += state.skipped
        if state.mesh_version:
            self.meshes.add(state.mesh_version)
            self.deviations_m.append(state.deviation_m)
        since = t_ns if self._tracked_ns is None else self._tracked_ns
        self.untracked_s = max(self.untracked_s, (t_ns - since) * 1e-9 if status != "TRACKING" else 0.0)
        if status == "TRACKING" or self._tracked_ns is None:
            self._tracked_ns = t_ns


@dataclass
class Summary:
    """Contents of a recording.

    Attributes:
        path: of the file.
        size_bytes: of the file.
        contents: its index.
        topics: by name.
        sensors: width and height by sensor [px].
        tracks: by tracker.
        losses: last value of every counter of losses, by component and name.
        damaged: chunks that cannot be read, and messages that cannot be parsed.
    """

    path: Path
    size_bytes: int
    contents: Contents
    topics: dict[str, Topic] = field(default_factory=dict)
    sensors: dict[str, tuple[int, int]] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)
    losses: dict[str, int] = field(default_factory=dict)
    damaged: int = 0
    _last: dict[str, tuple[int, int]] = field(default_factory=dict)  # epoch and exposure by stream

    def add(self, topic: str, schema: str, message: Message) -> None:
        """Takes a message."""
        one = self.topics.setdefault(topic, Topic(schema))
        one.size_bytes += len(message.data)
        one.times_ns.append(message.log_time)
        parse = self._parsers().get(schema)
        try:
            if parse is not None:
                parse(topic, message)
        except CodecError:
            self.damaged += 1

    def _parsers(self) -> Mapping[str, Callable[[str, Message], None]]:
        return {
            _INFO: self._add_info,
            _STATE: self._add_state,
            _HEALTH: self._add_health,
            _MODEL: self._add_model,
        }

    def _add_info(self, topic: str, message: Message) -> None:
        info = parse_message(FrameInfo, message.data)
        one = self.topics[topic]
        epoch, seq = self._last.get(topic, (info.epoch, info.seq - 1))
        one.lost += max(info.seq - seq - 1, 0) if info.epoch == epoch else 0
        one.reconnects += info.epoch != epoch
        self._last[topic] = info.epoch, info.seq

    def _add_state(self, topic: str, message: Message) -> None:
        state = parse_message(DeformationState, message.data)
        self.tracks.setdefault(state.tracker, Track()).add(state, message.log_time)

    def _add_model(self, topic: str, message: Message) -> None:
        model = parse_message(SensorModel, message.data)
        self.sensors[model.sensor] = model.width, model.height

    def _add_health(self, topic: str, message: Message) -> None:
        health = parse_message(Health, message.data)
        for name, number in health.counters.items():
            if number and (name.partition(".")[0] in LOSSES or _of_a_device(name)):
                self.losses[f"{health.component}: {name}"] = number


def _of_a_device(counter: str) -> bool:
    """True for what a device counts beside its frames: why exposures are missing that it never delivered."""
    return counter.startswith("device.") and not counter.endswith(".frames")


def summarize(path: Path, advance: Callable[[int, int], None]) -> Summary:
    """Reads every message of a recording, finished or not.

    Args:
        path: of the file.
        advance: called with the number of chunks read so far, and of all.

    Raises:
        RecordingError: the file cannot be read, or is not MCAP.
    """
    contents = scan(path)
    summary = Summary(path, path.stat().st_size, contents, damaged=contents.damaged)
    channels = contents.topics
    try:
        with path.open("rb") as stream:
            for number, place in enumerate(contents.chunks, 1):
                try:
                    records = read_chunk(stream, place)
                except DAMAGE:
                    summary.damaged += 1
                    continue
                for record in records:
                    if isinstance(record, Message) and record.channel_id in channels:
                        summary.add(channels[record.channel_id].name, channels[record.channel_id].schema, record)
                advance(number, len(contents.chunks))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error
    return summary
