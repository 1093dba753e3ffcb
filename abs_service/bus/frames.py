"""Frames on the bus: a sink that publishes the frames of a device, and a subscriber that decodes them."""

import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Self

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS, IMAGES, Bus, Publisher, Sample
from abs_service.bus.queues import LatestQueue
from abs_service.bus.sequence_gaps import SequenceGaps
from abs_service.bus.stamps import HeaderFactory
from drivers.contract.device import Sink, Truth
from drivers.contract.frame import Frame
from drivers.encoding import codec

#: Queue length per stream. A longer queue would only add latency.
DEPTH = 4


class FramePublisher(Sink):
    """Publishes the frames of one device from a thread of its own; states and warnings travel in the health.

    The device is never blocked: if publishing falls behind, the oldest frame of the stream is dropped and counted.
    One that no message can hold, by a mistake of the driver, is counted, too.

    Args:
        bus: where to publish.
        headers: makes the message headers.
        device: name of the device in the configuration; its truth is published under it.
    """

    def __init__(self, bus: Bus, headers: HeaderFactory, device: str) -> None:
        self._bus = bus
        self._headers = headers
        self._device = device
        self._publishers: dict[str, Publisher] = {}
        self._published: Counter[str] = Counter()
        self._refused: Counter[str] = Counter()
        self._trouble = ""
        self._queue: LatestQueue[Frame | Truth] = LatestQueue(DEPTH)
        self._thread = threading.Thread(target=self._run, name=f"publish {device}", daemon=True)
        self._thread.start()

    @property
    def published(self) -> Mapping[str, int]:
        """Messages published, by topic."""
        return dict(self._published)

    @property
    def dropped(self) -> Mapping[str, int]:
        """Messages that were not published, because publishing fell behind or they cannot be, by topic."""
        return self._refused + Counter(self._queue.dropped)

    def take_trouble(self) -> str:
        """The last reason since the last call why something cannot be published; "" if there was none."""
        trouble, self._trouble = self._trouble, ""
        return trouble

    def on_frame(self, frame: Frame) -> None:
        """See `drivers.contract.device.Sink.on_frame`."""
        self._queue.put(keys.image(frame.sensor, frame.stream), frame)

    def on_truth(self, truth: Truth) -> None:
        """See `drivers.contract.device.Sink.on_truth`."""
        self._queue.put(keys.truth(self._device), truth)

    def close(self) -> None:
        """Publishes the queued frames and ends the thread; may be called again."""
        self._queue.close()
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        while (entry := self._queue.take()) is not None:
            topic, item = entry
            try:
                if isinstance(item, Frame):
                    self._publish_frame(topic, item)
                else:
                    self._publish_truth(topic, item)
            except Exception as error:  # a number that no message holds, say: the next frames may be right
                self._refused[topic] += 1
                self._trouble = f"{topic} cannot be published: {error}"
                continue
            self._published[topic] += 1

    def _publish_frame(self, topic: str, frame: Frame) -> None:
        # Numbered as they are published: a gap is a loss of the bus. `FrameInfo.seq` counts exposures.
        header = self._headers.at(frame.t_host_ns, self._published[topic], frame.sensor)
        image = codec.encode_image(frame, self._headers.clock.wall(frame.t_host_ns))
        self._publisher(topic, codec.IMAGE_SCHEMA).put(image, codec.encode_info(frame, header))

    def _publish_truth(self, topic: str, truth: Truth) -> None:
        header = self._headers.at(truth.t_host_ns, truth.seq)
        self._publisher(topic, codec.TRUTH_SCHEMA).put(codec.encode_truth(truth, header))

    def _publisher(self, topic: str, message: str) -> Publisher:
        if topic not in self._publishers:
            qos = IMAGES if message == codec.IMAGE_SCHEMA else EVENTS
            self._publishers[topic] = self._bus.publisher(topic, message, qos)
        return self._publishers[topic]


class FrameSubscriber:
    """Receives the newest frames of some streams, in the order of arrival.

    A slow reader loses the oldest frames, counted. Messages that cannot be decoded, or never come, are counted, too.

    Args:
        bus: where the frames are published.
        streams: (sensor, stream) of each stream wanted.
        clock: CLOCK_MONOTONIC [ns], which tells when a frame is received.
        depth: frames per stream that may wait.
    """

    def __init__(
        self, bus: Bus, streams: Iterable[tuple[str, str]], clock: Callable[[], int], depth: int = DEPTH
    ) -> None:
        self._queue: LatestQueue[tuple[Sample, int]] = LatestQueue(depth)
        self._clock = clock
        self._malformed: Counter[str] = Counter()
        self._gaps = SequenceGaps(clock)
        self.last_error = ""
        self._subscriptions = [bus.subscribe(keys.image(sensor, stream), self._receive) for sensor, stream in streams]
        self._subscriptions.append(bus.subscribe(keys.health("capture"), self._gaps.add_health))

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames dropped from the full queue, by topic."""
        return self._queue.dropped

    @property
    def lost(self) -> Mapping[str, int]:
        """Frames that were published and did not come, by topic."""
        return self._gaps.lost

    @property
    def malformed(self) -> Mapping[str, int]:
        """Messages that hold no frame of their topic, by topic; `last_error` has the reason."""
        return dict(self._malformed)

    def take(self, timeout_s: float | None = None) -> Frame | None:
        """The next frame; None once `timeout_s` is over, after `close`, or if the message was malformed."""
        entry = self._queue.take(timeout_s)
        if entry is None:
            return None
        topic, (sample, t_received_ns) = entry
        try:
            frame = codec.decode(sample.payload, sample.attachment)
            if keys.image(frame.sensor, frame.stream) != topic:
                raise codec.CodecError(f"a frame of {frame.sensor}/{frame.stream} arrived on {topic}")
        except codec.CodecError as error:
            self._malformed[topic] += 1
            self.last_error = str(error)
            return None
        return replace(frame, t_received_ns=t_received_ns)

    def close(self) -> None:
        """Ends the subscriptions and wakes threads that wait in `take`."""
        for subscription in self._subscriptions:
            subscription.close()
        self._queue.close()

    def _receive(self, sample: Sample) -> None:
        self._gaps.add_image(sample)
        self._queue.put(sample.topic, (sample, self._clock()))
