"""Content of all displays, derived from the health of the components."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.health import published
from abs_service.supervision.children.child import Child, ChildState
from abs_service.supervision.health.rig_state import Received, RigState

#: Time without health of a component, which is due once a second, after which its numbers are out of date [ns].
SILENT_NS = 5_000_000_000


@dataclass(frozen=True)
class Stream:
    """One stream of images: its topic without `/image`, rate [Hz], age of the image last tracked [ms], losses."""

    name: str
    rate_hz: float
    age_ms: float | None
    published: int
    dropped: int


@dataclass(frozen=True)
class Recording:
    """The recorder: file being written, its size, bytes written per second; files, recorded and dropped messages.

    Those that never came are among the dropped ones. `forecast` says how long the disk lasts; "" in the first seconds.
    """

    file: Path
    size: int
    rate: float
    files: int
    recorded: int
    dropped: int
    forecast: str


@dataclass(frozen=True, slots=True)
class RigPlaces:
    """Name of a rig, and where it is found.

    Attributes:
        name: of the rig.
        endpoint: where applications connect.
        directory: folder of the recordings.
        captured_at: endpoint of the host that captures; "" if this one does.
    """

    name: str
    endpoint: str = ""
    directory: Path = field(default_factory=Path)
    captured_at: str = ""


@dataclass(frozen=True)
class RigView:
    """Snapshot of a running rig.

    Attributes:
        rig: its name and places.
        live: current state of the rig.
        children: the processes.
        elapsed_s: time since the start.
        now_ns: CLOCK_MONOTONIC [ns].
        host_clock: which host's clock that is, see `drivers.contract.host_clock`; ages on others are not shown.
        refused: messages that this process did not take, in words.
        rivals: topics that another process publishes, too, in words.
        silent: for how long there has been no estimate, in words, by each tracker of which that is too long.
    """

    rig: RigPlaces
    live: RigState
    children: Sequence[Child]
    elapsed_s: float
    now_ns: int
    host_clock: str
    refused: str = ""
    rivals: str = ""
    silent: Mapping[str, str] = field(default_factory=dict)

    @property
    def streams(self) -> list[Stream]:
        """All streams of images, by name."""
        counters, ages = self.live.counters("capture"), self._ages_ms()
        gauges = self.gauges("capture")
        return [
            Stream(
                name=topic.removesuffix("/image"),
                rate_hz=gauges.get(f"rate_hz.{topic}", 0.0),
                age_ms=ages.get(topic.partition("/")[0]),
                published=number,
                dropped=counters[f"dropped.{topic}"],
            )
            for topic, number in sorted(published(counters).items())
            if keys.is_image(topic)
        ]

    def gauges(self, component: str) -> Mapping[str, float]:
        """Present gauges of a component; none if it is silent or has ended: its numbers are no more."""
        received = self.live.received.get(component, Received())
        ended = any(child.component == component and child.state is not ChildState.RUNNING for child in self.children)
        return received.health.gauges if not ended and self.now_ns - received.t_ns < SILENT_NS else {}

    @property
    def recording(self) -> Recording | None:
        """The recorder; None if it did not begin a file."""
        health, counters = self.live.health("record"), self.live.counters("record")
        if not health.labels.get("file"):
            return None
        return Recording(
            file=self.rig.directory / Path(health.labels["file"]).name.removesuffix(".active"),
            size=int(health.gauges.get("file_bytes", 0)),
            rate=self.live.received["record"].rate("file_bytes"),
            files=counters["files"],
            recorded=counters["recorded"],
            dropped=dropped(counters),
            forecast=health.labels.get("forecast", "") if self.streams else "",  # configurations alone last for years
        )

    @property
    def recording_remark(self) -> str:
        """The recorder's remark on missing tracking, or on its trigger; "" if it records anyway."""
        labels = self.live.health("record").labels
        return labels.get("tracking") or labels.get("trigger", "")

    @property
    def troubles(self) -> list[tuple[str, int, str]]:
        """Component, level and message of everything that needs attention."""
        found: list[tuple[str, int, str]] = [
            (name, received.health.level, received.health.message)
            for name, received in sorted(self.live.received.items())
            if received.health.level >= Health.LEVEL_WARNING and received.health.message and name != "run"
        ]
        found += [("run", Health.LEVEL_WARNING, self.refused)] if self.refused else []
        found += [("run", Health.LEVEL_ERROR, self.rivals)] if self.rivals else []
        found += [("run", Health.LEVEL_ERROR, self.capture_silence)] if self.capture_silence else []
        for child in self.children:
            given_up = child.state is ChildState.FAILED
            if given_up or child.lacks:
                words = f"given up: {child.reason}" if given_up else child.reason
                found.append((child.component, Health.LEVEL_ERROR, words))
        return found

    @property
    def capture_silence(self) -> str:
        """Silence of the host that captures, in words with its duration; "" if it sends, or is this one."""
        last_ns = self.live.received.get("capture", Received()).t_ns
        silent_s = min((self.now_ns - last_ns) * 1e-9, self.elapsed_s)
        if not self.rig.captured_at or silent_s * 1e9 < SILENT_NS:
            return ""
        return f"nothing comes from capture --listen at {self.rig.captured_at}, for {silent_s:.0f} s"

    @property
    def activity(self) -> str:
        """Current stage of the start; "" once there are estimates, or if nothing is tracked."""
        if self.live.preparing():
            compiled = self.live.compiled()
            return f"Compiling kernels for this rig: {compiled} …" if compiled else "Loading kernels …"
        if "capture" not in self.live.received:
            elsewhere = f"Waiting for capture --listen of {self.rig.name} at {self.rig.captured_at} …"
            return elsewhere if self.rig.captured_at else "Starting the processes …"
        if any(tracker.last is None for tracker in self.live.trackers.values()):
            return "Waiting for the first estimate …"
        return ""

    def summary(self) -> list[str]:
        """Summary in a few lines."""
        streams, recording = self.streams, self.recording
        frames = sum(stream.published for stream in streams)
        dropped = sum(stream.dropped for stream in streams)
        lines = [f"{self.elapsed_s:.1f} s, {frames} images, {dropped} dropped"]
        for name, tracker in self.live.trackers.items():
            lines += [f"{name}: {line}" for line in tracker.summary()]
            if images := lost(self.live.counters(f"track/{name}")):
                lines.append(f"{name}: {images} images were lost on their way to it")
        if recording:
            files = f"; {recording.files} files" if recording.files > 1 else ""
            numbers = f"{files}, {recording.recorded} messages, {recording.dropped} dropped"
            lines.append(f"{_on_disk(recording.file)}: {size(recording.size)}{numbers}")
        if failures := self.live.counters("record")["failures"]:
            reason = self.live.health("record").labels.get("last_failure", "")
            lines.append(f"recording failed {failures}×" + (f", last: {reason}" if reason else ""))
        restarts = {child.component: child.restarts for child in self.children if child.restarts}
        if restarts:
            lines.append("restarts: " + ", ".join(f"{name} {number}" for name, number in restarts.items()))
        return lines

    def _ages_ms(self) -> dict[str, float]:
        ages: dict[str, float] = {}
        trackers = [one for one in self.live.trackers.values() if one.host_clock == self.host_clock]
        for tracker in trackers:
            for sensor, t_host_ns in tracker.exposure_ns.items():
                age_ms = (self.now_ns - t_host_ns) * 1e-6
                ages[sensor] = min(age_ms, ages.get(sensor, age_ms))
        return ages


def dropped(counters: Mapping[str, int]) -> int:
    """Messages that a component could not take, and those that never came to it, by the counters of its health."""
    return sum(number for name, number in counters.items() if name.startswith("dropped.")) + lost(counters)


def lost(counters: Mapping[str, int]) -> int:
    """Messages that never came to a component, by the counters of its health."""
    return sum(number for name, number in counters.items() if name.startswith("lost."))


def size(number: float) -> str:
    """Bytes for people: 1.2 MB."""
    for unit in ("B", "kB", "MB"):
        if abs(number) < 1000:
            return f"{number:.0f} {unit}" if unit == "B" else f"{number:.1f} {unit}"
        number /= 1000
    return f"{number:.2f} GB"


def _on_disk(path: Path) -> str:
    """The file of a recording whose recorder has ended, and its state, as text."""
    active = path.with_name(path.name + ".active")
    if active.exists():
        return f"{active} (unfinished: `abs-service recover` completes it)"
    return str(path) if path.exists() else f"{path} (is gone)"
