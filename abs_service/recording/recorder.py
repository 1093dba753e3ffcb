"""Records all messages of a rig, images as the settings say; reports losses and failures in its health."""

import shutil
import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from absmsg.v1.sensor_model_pb2 import SensorModel
from google.protobuf.json_format import MessageToJson

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample
from abs_service.bus.health import Health, Level
from abs_service.bus.queues import BoundedQueue
from abs_service.bus.stamps import WallClock
from abs_service.recording.recording_file import RecordingFile, open_for_writing
from abs_service.wire import message_header as header
from abs_service.wire.message_header import MessageHeaderError
from drivers.encoding.encoded_image import ImageEncoder, unchanged
from drivers.encoding.mcap_file import CHUNK_SIZE, Compression, McapFileError
from drivers.encoding.message_check import LARGEST_GAP
from drivers.encoding.parsing import CodecError

#: Messages repeated at the start of each file, so that every file is self-contained.
_LATCHED = frozenset({header.CALIBRATION, header.CONFIG, header.MODEL, header.TOPOLOGY, header.TRANSFORMS})
#: Timeout of the queries at the start [s].
QUERY_S = 1.0


@dataclass(frozen=True, slots=True)
class RecorderSettings:
    """Settings of the recorder.

    Attributes:
        directory: where the files go; must exist.
        name: beginning of their names.
        rig_toml: effective configuration, attached to every file.
        encode_image: makes the recorded message of an image.
        compression, chunk_bytes: of the MCAP chunks.
        flush_s: longest time until a message is on disk, and so the most that a crash can lose.
        rotate_bytes, rotate_s: size and age at which a new file begins.
        minimum_free_bytes: free space at which recording ends.
        queue_bytes: messages that may wait for a slow disk; more are dropped and counted.
    """

    directory: Path
    name: str
    rig_toml: str
    encode_image: ImageEncoder = unchanged
    compression: Compression = Compression.LZ4
    chunk_bytes: int = CHUNK_SIZE
    flush_s: float = 1.0
    rotate_bytes: int = 4_000_000_000
    rotate_s: float = 3600.0
    minimum_free_bytes: int = 1_000_000_000
    queue_bytes: int = 256 << 20


class Recorder:
    """Writes all messages of a rig to MCAP files, from a thread of its own.

    The first error of the disk ends recording: what was written stays, as `*.mcap.active`, for `recovery`, and health
    says RECORD_FAILED. A retry would leave unnoticed gaps.

    Args:
        bus: the rig.
        settings: where and how.
        health: of this component.
        clock: stamps what has no stamp and measures ages.
        open_file: creates a file; a test may give a slow or full one.
        free_bytes: free space of the file system of a folder.
    """

    def __init__(
        self,
        bus: Bus,
        settings: RecorderSettings,
        health: Health,
        clock: WallClock,
        open_file: Callable[[Path], BinaryIO] = open_for_writing,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    ) -> None:
        self._bus = bus
        self._settings = settings
        self._health = health
        self._clock = clock
        self._open_file = open_file
        self._free_bytes = free_bytes
        self._queue: BoundedQueue[Sample] = BoundedQueue(settings.queue_bytes)
        self._latched: dict[str, Sample] = {}
        self._last_seq: dict[str, int] = {}
        self._counts: Counter[str] = Counter()  # of the open file
        self._attached: dict[str, str] = {}  # to the open file: calib_id by sensor
        self._reported_drops: Counter[str] = Counter()  # drops in the metadata of finished files
        self._failed = ""
        self._thread = threading.Thread(target=self._run, name="record", daemon=True)

    @property
    def failed(self) -> str:
        """Error that ended recording before `stop`; "" if there is none."""
        return self._failed

    def start(self) -> None:
        """Subscribes and begins to write."""
        self._subscription = self._bus.subscribe(
            "**", lambda sample: self._queue.put(sample.topic, sample, sample.size)
        )
        # Only now, so that nothing falls between the answers and the subscription.
        answers = self._bus.query("**", QUERY_S)
        self._latched = {sample.topic: sample for sample in answers if sample.message in _LATCHED}
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Writes what waits and finishes the file; gives up after `timeout_s`, which leaves it to be recovered."""
        self._subscription.close()
        self._queue.close()
        self._thread.join(timeout_s)

    def report(self) -> None:
        """Updates the counters and gauges of health; call it before `Health.tick`."""
        self._health.count_up_to(self._queue.dropped, "dropped.")
        self._health.gauge("queue_bytes", self._queue.size)
        lost = sum(self._queue.dropped.values())
        if not self._failed:
            level = Level.WARNING if lost else Level.OK
            self._health.report("queue", level, f"the disk is too slow: {lost} messages dropped" if lost else "")

    def _run(self) -> None:
        try:
            while self._record_one_file():
                pass
        except OSError as error:
            self._fail(str(error))
        except Exception as error:
            self._fail(f"{type(error).__name__}: {error}")  # our own mistake, but it must not go unnoticed
            raise
        finally:
            self._queue.close()
            while self._queue.take(0) is not None:
                pass

    def _record_one_file(self) -> bool:
        """Records until a reason to end the file; returns whether another one shall follow."""
        settings, started_ns = self._settings, self._clock.monotonic()
        file = RecordingFile(
            settings.directory,
            settings.name,
            self._clock.wall(started_ns),
            {"rig.toml": settings.rig_toml},
            settings.compression,
            settings.chunk_bytes,
            self._open_file,
        )
        self._health.label("file", file.path.name)
        self._health.count("files")
        self._counts = Counter()
        self._attached = {}
        try:
            for sample in self._latched.values():
                self._write(file, sample, is_repeated=True)
            reason = self._fill(file, started_ns)
            file.finish({"ended": reason, **self._summary()})
        except BaseException:
            self._health.label("file", file.abandon().name)
            raise
        if reason == "low space":
            free = self._free_bytes(settings.directory)
            self._fail(f"only {free / 1e6:.0f} MB free in {settings.directory}; make room and start again")
        return reason == "rotated"

    def _fill(self, file: RecordingFile, started_ns: int) -> str:
        settings, flush_ns = self._settings, int(self._settings.flush_s * 1e9)
        next_flush_ns = started_ns + flush_ns
        while True:
            sample = self._queue.take(max(0.0, (next_flush_ns - self._clock.monotonic()) / 1e9))
            if sample is not None:
                self._write(file, sample)
            elif self._queue.is_drained:
                return "stopped"
            now_ns = self._clock.monotonic()
            if now_ns < next_flush_ns:
                continue
            next_flush_ns = now_ns + flush_ns
            file.flush()
            self._health.gauge("file_bytes", file.size)
            free = self._free_bytes(settings.directory)
            self._health.gauge("free_bytes", free)
            if free < settings.minimum_free_bytes:
                return "low space"
            if file.size >= settings.rotate_bytes or now_ns - started_ns >= settings.rotate_s * 1e9:
                return "rotated"

    def _write(self, file: RecordingFile, sample: Sample, is_repeated: bool = False) -> None:
        if sample.topic == keys.SCHEMA:
            return
        try:
            about = header.parse(sample)
            stamp_ns = self._stamp_ns(about.stamp_ns, is_repeated)
            message, payload = sample.message, sample.payload
            if message == header.IMAGE:
                message, payload = self._settings.encode_image(payload)
            file.write(sample.topic, message, payload, stamp_ns, about.seq)
            if keys.is_image(sample.topic) and sample.attachment:
                file.write(keys.info(sample.topic), header.INFO, sample.attachment, stamp_ns, about.seq)
        except (MessageHeaderError, CodecError, McapFileError) as error:
            # Other programs can publish below our keys; that must not end the recording.
            self._health.count("refused")
            self._health.label("refused", str(error))
            return
        if sample.message == header.MODEL:
            self._attach_calibration(file, sample, stamp_ns)
        self._count(sample.topic, about.seq)
        if sample.message in _LATCHED:
            self._latched[sample.topic] = sample

    def _attach_calibration(self, file: RecordingFile, sample: Sample, stamp_ns: int) -> None:
        """Attaches what a sensor is, when the file does not hold it yet, to be had without reading messages."""
        model = SensorModel.FromString(sample.payload)
        if self._attached.get(model.sensor) != model.calib_id:
            text = MessageToJson(model, preserving_proto_field_name=True)
            file.attach(f"calibration/{model.sensor}.json", "application/json", text, stamp_ns)
            self._attached[model.sensor] = model.calib_id

    def _stamp_ns(self, stamp_ns: int, is_repeated: bool) -> int:
        is_usable = 0 < stamp_ns < 1 << 63
        return stamp_ns if is_usable and not is_repeated else self._clock.wall(self._clock.monotonic())

    def _count(self, topic: str, seq: int) -> None:
        self._counts[f"messages.{topic}"] += 1
        self._health.count("recorded")
        gap = seq - self._last_seq.get(topic, seq) - 1
        if 0 < gap <= LARGEST_GAP:  # lost before they came here
            self._counts[f"missing.{topic}"] += gap
            self._health.count(f"missing.{topic}", gap)
        self._last_seq[topic] = seq

    def _summary(self) -> dict[str, str]:
        """Counts of messages in the file, and of lost ones."""
        dropped = Counter(self._queue.dropped)
        for topic, number in (dropped - self._reported_drops).items():
            self._counts[f"dropped.{topic}"] = number
        self._reported_drops = dropped
        return {name: str(number) for name, number in sorted(self._counts.items())}

    def _fail(self, reason: str) -> None:
        self._failed = reason
        self._subscription.close()
        self._health.report("record", Level.ERROR, f"RECORD_FAILED {reason}")
