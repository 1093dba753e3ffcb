"""A live tracker loses nothing without saying so."""

from itertools import count

import numpy as np
import pytest
from abs.v1.health_pb2 import Health as HealthMessage

from abs_service import keys
from abs_service.bus.contract import IMAGES
from abs_service.bus.frames import DEPTH, FramePublisher, FrameSubscriber
from abs_service.health import Health
from abs_service.stamps import Speaker, WallClock
from abs_service.synchroniser import Synchroniser
from abs_service.track import LiveTracker, NewestSets
from drivers import codec
from drivers.frame import Frame, Geometry, Kind
from tests.service.loopback import LoopbackBus

STREAMS = [("tof", "depth"), ("color", "color")]
PERIOD_NS = 33_000_000


def depth(k):
    t_ns = k * PERIOD_NS
    return Frame(
        "tof", "depth", Kind.DEPTH, np.ones((4, 4), "<u2"), "16UC1", t_ns, t_ns, k, 0, geometry=Geometry.RADIAL
    )


def color(k):
    t_ns = k * PERIOD_NS
    return Frame("color", "color", Kind.COLOR, np.ones((4, 4, 3), np.uint8), "rgb8", t_ns, t_ns, k, 0)


class Bench:
    """A live tracker whose tracker is never asked."""

    def __init__(self):
        self.bus = LoopbackBus()
        clock = WallClock()
        self.speaker = Speaker("demo", clock)
        self.frames = FrameSubscriber(self.bus, STREAMS)
        self.sets = NewestSets(self.frames, Synchroniser(STREAMS[0], STREAMS, 10**7), lambda: 0)
        self.health = Health(self.bus, "track/sheet", self.speaker)
        ticks = count()
        self.live = LiveTracker(None, self.sets, None, self.health, lambda: next(ticks), 20.0)  # type: ignore[arg-type]

    def publish(self, *frames):
        with FramePublisher(self.bus, self.speaker, "sim") as publisher:
            for frame in frames:
                publisher.on_frame(frame)

    def published_health(self):
        self.live.report()
        self.health.publish()
        return HealthMessage.FromString(self.bus.sent[-1].payload)


@pytest.fixture
def bench():
    return Bench()


def test_the_newest_set_is_taken_and_older_ones_are_counted(bench):
    bench.publish(depth(1), color(1), depth(2), color(2), depth(3), color(3))
    assert bench.sets.take().stamp_ns == 3 * PERIOD_NS
    assert bench.published_health().counters["skipped"] == 2


def test_what_never_became_a_set_is_in_the_health_even_if_nothing_comes_any_more(bench):
    for k in range(1, DEPTH + 3):  # two more than may wait
        bench.publish(depth(k))
    bench.publish(color(9), color(9))
    assert bench.sets.take() is not None
    topic = keys.image("tof", "depth")
    image = codec.encode_image(depth(20), 0)
    bench.bus.publisher(topic, codec.IMAGE_SCHEMA, IMAGES).put(image, b"no description")
    assert bench.sets.take() is None
    bench.live.turn()
    health = bench.published_health()
    assert health.counters[f"dropped.{topic}"] == 2
    assert health.counters[f"malformed.{topic}"] == 1
    assert health.counters["unused.color/color.duplicate"] == 1
    assert health.labels["malformed"] == bench.frames.last_error != ""
