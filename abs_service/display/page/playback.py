"""A recording as a source of messages: at a time that the user chooses, played, paused, step by step."""

import re
from collections.abc import Callable, Iterator, Set
from dataclasses import dataclass, replace
from itertools import chain, takewhile
from pathlib import Path

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import MeshTopology
from absmsg.v1.sensor_model_pb2 import SensorModel
from mcap.records import Message

from abs_service.bus.contract import Sample
from abs_service.wire.edge import SCHEMAS, check_sample
from drivers.encoding import codec, encoded_image
from drivers.encoding.message_content import MessageError
from drivers.encoding.parsing import CodecError
from drivers.replay.contents import Topic, scan
from drivers.replay.messages import messages

#: After a jump, messages of this period before are delivered as well, so that all periodic ones are there [s].
BEFORE_S = 3.0

_STATE = DeformationState.DESCRIPTOR.full_name
#: Messages that hold until there is another one.
_LATCHED = frozenset({MeshTopology.DESCRIPTOR.full_name, SensorModel.DESCRIPTOR.full_name})


@dataclass(eq=False)
class Listener:
    """A subscription: a pattern of topics, and what is called; `close` ends it."""

    listeners: list["Listener"]
    pattern: re.Pattern[str]
    on_sample: Callable[[Sample], None]

    def close(self) -> None:
        """Ends the subscription; may be called again."""
        if self in self.listeners:
            self.listeners.remove(self)


class Playback:
    """Delivers the messages of a recording to subscribers, from `advance`, up to a time that moves with a clock.

    A new subscriber gets what is there at the present time. All methods are for one thread.

    Args:
        path: of the file.
        clock: monotonic time [ns].

    Attributes:
        duration_s: from the first to the last message [s].
        speed: factor on the recorded speed.
        playing: True while time goes on.
        malformed: messages that are none of ours, and were left out.

    Raises:
        RecordingError: the file cannot be read, or is not MCAP.
    """

    def __init__(self, path: Path, clock: Callable[[], int]) -> None:
        self._path, self._clock, self._contents = path, clock, scan(path)
        self._begin_ns = self._now_ns = self._contents.start_ns
        self.duration_s = (self._contents.end_ns - self._begin_ns) * 1e-9
        self.speed, self.playing, self.malformed = 1.0, True, 0
        self._listeners: list[Listener] = []
        self._coming: Iterator[tuple[int, Sample]] = iter(())
        self._next: tuple[int, Sample] | None = None
        self._jump_due = True
        self._last_ns = clock()
        schemas = {topic.schema for topic in self._contents.topics.values()}
        self._wanted = (SCHEMAS.keys() | encoded_image.SCHEMAS | {codec.INFO_SCHEMA}) & schemas
        self._steps = {_STATE} & schemas or encoded_image.SCHEMAS & schemas
        self._latched = list(messages(path, self._contents, _LATCHED))

    @property
    def position_s(self) -> float:
        """The present time, from the first message [s]."""
        return (self._now_ns - self._begin_ns) * 1e-9

    def now_ns(self) -> int:
        """The present time of the recording [ns]; while a message is delivered, its own."""
        return self._now_ns

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Listener:
        """Calls `on_sample` for each message on matching topics, from `advance`."""
        expression = re.escape(pattern).replace(r"\*\*", ".+").replace(r"\*", "[^/]+")
        listener = Listener(self._listeners, re.compile(expression), on_sample)
        self._listeners.append(listener)
        self._jump_due = True
        return listener

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """The last message that holds on a topic; none is waited for."""
        found = [
            Sample(pattern, topic.schema, one.data)
            for topic, one in self._latched
            if topic.name == f"/{pattern}" and one.log_time <= self._now_ns
        ]
        return found[-1:]

    def jump(self, position_s: float) -> None:
        """Goes to a time, from the first message [s]."""
        self._now_ns = self._begin_ns + round(1e9 * min(max(position_s, 0.0), self.duration_s))
        self._jump_due = True

    def step(self, forward: bool) -> None:
        """Pauses, and goes to the next or the last estimate, or image where there are no estimates."""
        self.playing = False
        now_ns = self._now_ns
        begin_ns = now_ns + 1 if forward else now_ns - round(1e9 * BEFORE_S)
        times = (one.log_time for _, one in self._from(begin_ns, self._steps))
        there = next(times, now_ns) if forward else max(takewhile(lambda time: time < now_ns, times), default=now_ns)
        self._now_ns, self._jump_due = there, True

    def play(self) -> None:
        """Goes on, from the begin if this is the end."""
        self.playing = True
        if self._now_ns >= self._contents.end_ns:
            self.jump(0.0)

    def advance(self) -> None:
        """Delivers what has come since the last call, or what there is after a jump; pauses at the last message.

        Time stands still while nobody listens to images.
        """
        now_ns = self._clock()
        elapsed_ns, self._last_ns = now_ns - self._last_ns, now_ns
        target_ns = self._now_ns
        if not any(listener.pattern.fullmatch("a/b/image") for listener in self._listeners):
            return
        if self._jump_due:
            self._jump_due = False
            self._coming = self._samples(target_ns)
            self._next = next(self._coming, None)
        elif self.playing:
            target_ns = min(target_ns + round(self.speed * elapsed_ns), self._contents.end_ns)
            self.playing = target_ns < self._contents.end_ns
        else:
            return
        self._deliver(target_ns)
        self._now_ns = target_ns

    def _deliver(self, target_ns: int) -> None:
        while self._next is not None and self._next[0] <= target_ns:
            self._now_ns, sample = self._next
            for listener in tuple(self._listeners):
                if listener.pattern.fullmatch(sample.topic):
                    listener.on_sample(sample)
            self._next = next(self._coming, None)

    def _from(self, t_ns: int, schemas: Set[str]) -> Iterator[tuple[Topic, Message]]:
        """Messages from a time on, in order; chunks before it are not read."""
        chunks = tuple(chunk for chunk in self._contents.chunks if chunk.end_ns >= t_ns)
        found = messages(self._path, replace(self._contents, chunks=chunks), schemas)
        return ((topic, message) for topic, message in found if message.log_time >= t_ns)

    def _samples(self, t_ns: int) -> Iterator[tuple[int, Sample]]:
        """Messages that hold at a time, then all that follow it, with the time of each [ns]."""
        begin_ns = t_ns - round(1e9 * BEFORE_S)
        holding = {topic.name: (topic, one) for topic, one in self._latched if one.log_time < begin_ns}
        before = sorted(holding.values(), key=lambda item: item[1].log_time)
        waiting: dict[tuple[str, int, int], tuple[Topic, Message]] = {}
        for topic, message in chain(before, self._from(begin_ns, self._wanted)):
            if topic.schema in encoded_image.SCHEMAS or topic.schema == codec.INFO_SCHEMA:
                key = (topic.name.rpartition("/")[0], message.log_time, message.sequence)
                partner = waiting.pop(key, None)
                if partner is None:
                    waiting[key] = topic, message
                    continue
                image, info = sorted((partner, (topic, message)), key=lambda one: one[0].schema == codec.INFO_SCHEMA)
                sample = self._image(*image, info[1])
            else:
                sample = self._checked(Sample(topic.name[1:], topic.schema, message.data))
            if sample is not None:
                yield message.log_time, sample

    def _image(self, topic: Topic, image: Message, info: Message) -> Sample | None:
        """An image as it was on the bus; None if it is none."""
        try:
            payload = encoded_image.decode(topic.schema, image.data)
        except CodecError:
            self.malformed += 1
            return None
        return self._checked(Sample(topic.name[1:], codec.IMAGE_SCHEMA, payload, info.data))

    def _checked(self, sample: Sample) -> Sample | None:
        try:
            check_sample(sample)
        except MessageError:
            self.malformed += 1
            return None
        return sample
