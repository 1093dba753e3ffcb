"""Writes the messages of a rig to one file after the other, and counts them."""

import threading
from collections import Counter, deque
from collections.abc import Iterable, Mapping

from absmsg.v1.sensor_model_pb2 import SensorModel
from google.protobuf.json_format import Error as JsonError
from google.protobuf.json_format import MessageToJson

from abs_service.bus import keys
from abs_service.bus.contract import Bus, Sample
from abs_service.bus.health import Health
from abs_service.bus.sequence_gaps import SequenceGaps
from abs_service.bus.stamps import STEP_NS, WallClock
from abs_service.recording.take import Take
from abs_service.recording.topologies import Topologies
from abs_service.wire import message_header as header
from drivers.contract.host_clock import host_clock
from drivers.encoding.encoded_image import ImageEncoder
from drivers.encoding.mcap_file import McapFileError
from drivers.encoding.parsing import CodecError

#: Messages repeated at the start of each file, so that every file is self-contained.
_LATCHED = frozenset({header.CALIBRATION, header.CONFIG, header.MODEL, header.TOPOLOGY, header.TRANSFORMS})

#: Timeout of the query for a topology that did not come [s].
QUERY_S = 0.2

#: Offsets of the wall clock that are remembered: a step that a process has not noticed may be followed by others.
_OFFSETS = 8


class SampleWriter:
    """Writes samples to a file, images as encoded, and refuses messages of other schemas.

    Args:
        encode_image: makes the recorded message of an image.
        health: of the recorder; has the counters.
        clock: stamps messages without a stamp; its wall clock at the beginning of a file is that of the whole file.
    """

    def __init__(self, encode_image: ImageEncoder, health: Health, clock: WallClock) -> None:
        self._encode_image = encode_image
        self._health = health
        self._clock = clock
        self._offset_ns = clock.wall(0)  # of the open file
        self._offsets_ns = deque([self._offset_ns], _OFFSETS)  # the last one is that of now
        self._host_clock = host_clock()
        self._lock = threading.Lock()
        self._latched: dict[str, Sample] = {}
        self._late: dict[str, Sample] = {}  # by topic, for the open file
        self._topologies = Topologies()
        self._gaps = SequenceGaps()
        self._counts: Counter[str] = Counter()  # of the open file
        self._attached: dict[str, str] = {}  # to the open file: calib_id by sensor
        self._reported_drops: Counter[str] = Counter()  # drops in the metadata of finished files
        self.unsaved = 0  # messages written since `saved` was called

    def latch(self, samples: Iterable[Sample]) -> None:
        """Remembers those of the samples that each file begins with; called from any thread."""
        with self._lock:
            self._latched |= {sample.topic: sample for sample in samples if sample.message in _LATCHED}

    def ask_for_missing(self, bus: Bus) -> None:
        """Asks for topologies that did not come; they are written with the next message. Called from any thread."""
        for tracker in self._topologies.missing():
            answers = bus.query(keys.topology(tracker), QUERY_S)
            self.latch(answers)
            with self._lock:
                self._late |= {one.topic: one for one in answers}

    def begin(self, take: Take) -> None:
        """Begins a recording with the metadata that makes it self-contained. Raises as `write`."""
        self._counts = Counter()
        self._attached = {}
        self._offset_ns = self._clock.wall(0)
        self.unsaved = 0
        with self._lock:
            latched, self._late = list(self._latched.values()), {}
        for sample in latched:
            self.write(take, sample, is_repeated=True)

    def saved(self) -> None:
        """All that was written is on disk."""
        self.unsaved = 0

    def pause(self) -> None:
        """Marks a pause on purpose: the gap after it is no loss."""
        self._gaps.forget()

    def write(self, take: Take, sample: Sample, is_repeated: bool = False) -> None:
        """Writes one message and counts it.

        Raises:
            OSError: the file cannot be written.
        """
        if sample.topic == keys.SCHEMA:
            return
        with self._lock:
            late, self._late = self._late, {}
        for one in late.values():
            self.write(take, one, is_repeated=True)
        self.unsaved += 1
        try:
            about = header.parse(sample)
            stamp_ns = self._stamp_ns(about, is_repeated)
            message, payload = sample.message, sample.payload
            if message == header.IMAGE:
                message, payload = self._encode_image(payload)
            if sample.message == header.MODEL:
                self._attach_calibration(take, sample, stamp_ns)
            take.write(sample.topic, message, payload, stamp_ns, about.seq)
            if keys.is_image(sample.topic) and sample.attachment:
                take.write(keys.info(sample.topic), header.INFO, sample.attachment, stamp_ns, about.seq)
        except (CodecError, McapFileError, JsonError, ValueError) as error:
            # Other programs can publish below our keys; that must not end the recording.
            self._health.count("refused")
            self._health.label("refused", str(error))
            return
        self._count(sample.topic, about)
        self._topologies.add(sample, about)
        self.latch([sample])

    def summary(self, dropped: Mapping[str, int]) -> dict[str, str]:
        """Counts of messages in the file, and of lost ones, where `dropped` has the totals of the queue by topic."""
        total = Counter(dropped)
        for topic, number in (total - self._reported_drops).items():
            self._counts[f"dropped.{topic}"] = number
        self._reported_drops = total
        return {name: str(number) for name, number in sorted(self._counts.items())}

    def _attach_calibration(self, take: Take, sample: Sample, stamp_ns: int) -> None:
        """Attaches the metadata of a sensor once, readable without reading messages."""
        model = SensorModel.FromString(sample.payload)
        keys.check_name(model.sensor)  # a program that saves attachments as files must not leave its folder
        if self._attached.get(model.sensor) != model.calib_id:
            text = MessageToJson(model, preserving_proto_field_name=True)
            take.attach(f"calibration/{model.sensor}.json", "application/json", text, stamp_ns)
            self._attached[model.sensor] = model.calib_id

    def _stamp_ns(self, about: header.MessageHeader, is_repeated: bool) -> int:
        """Time of a message in the file, where no step of this host's wall clock changes their order."""
        stamp_ns = about.stamp_ns
        if about.host_clock == self._host_clock:
            stamp_ns = about.t_host_ns + self._offset_ns
        elif stamp_ns and not about.host_clock:
            stamp_ns += self._offset_ns - self._offset_of(stamp_ns)
        is_usable = about.stamp_ns > 0 and 0 < stamp_ns < 1 << 63 and not is_repeated
        return stamp_ns if is_usable else self._clock.monotonic() + self._offset_ns

    def _offset_of(self, stamp_ns: int) -> int:
        """Offset of the wall clock by which the stamp of a present moment was made, by the nearest of the last ones.

        Each process notices a step within a second; this one may be earlier or later than the one that made the stamp.
        """
        self._clock.measure()
        offset_ns, now_ns = self._clock.wall(0), self._clock.monotonic()
        if abs(offset_ns - self._offsets_ns[-1]) <= STEP_NS:
            self._offsets_ns.pop()
        self._offsets_ns.append(offset_ns)
        return min(self._offsets_ns, key=lambda one: abs(stamp_ns - one - now_ns))

    def _count(self, topic: str, about: header.MessageHeader) -> None:
        self._counts[f"messages.{topic}"] += 1
        self._health.count("recorded")
        if gap := self._gaps.add(topic, about.publisher, about.seq):  # lost before they came here
            self._counts[f"missing.{topic}"] += gap
            self._health.count(f"missing.{topic}", gap)
