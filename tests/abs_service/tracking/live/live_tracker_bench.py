"""A live tracker on a loopback bus."""

import dataclasses
from collections import Counter

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health as Message

from abs_service.bus import keys
from abs_service.bus.clock_offsets import ClockOffsets
from abs_service.bus.contract import IMAGES
from abs_service.bus.frames import FrameSubscriber
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.pairing.common_clock import CommonClock
from abs_service.pairing.frame_set_queue import FrameSetQueue
from abs_service.pairing.synchroniser import Synchroniser
from abs_service.tracker.optimizers import cma
from abs_service.tracking.live.estimate_publisher import EstimatePublisher
from abs_service.tracking.live.live_tracker import LiveTracker
from abs_service.tracking.live.tracker_health import TrackerHealth
from abs_service.tracking.observer import streams
from abs_service.tracking.session import TrackingSession
from drivers.contract.frame import Kind
from drivers.encoding import codec
from tests.abs_service.bus.loopback import LoopbackBus
from tests.abs_service.tracking.driving import default_plan, rig_of, simulate

SIMULATION = simulate("simulated://sheet?seed=1")
RIG = rig_of(SIMULATION)
MEMBERS = streams(RIG.sensors.values())


class Bench:
    """A live tracker on a loopback bus with a clock that only the test moves."""

    def __init__(self, budget_ms=1e6, tolerance_ns=12_000_000, view_hz=0.0, **parts):
        self.now_ns = self.tick_ns = 0
        self.bus = LoopbackBus()
        self.wall = WallClock(monotonic=lambda: self.now_ns, wall=lambda: self.now_ns + 10**18)
        self.headers = self.capture = HeaderFactory("demo", self.wall, host="here")
        self.health = Health(self.bus, "track/sheet", self.headers)
        frames = FrameSubscriber(self.bus, MEMBERS, lambda: self.now_ns)
        self.clocks = ClockOffsets(self.bus, lambda: self.now_ns, "here")
        common_clock = CommonClock(MEMBERS[0], tolerance_ns, self.clocks.offset)
        synchroniser = Synchroniser(MEMBERS[0], MEMBERS, tolerance_ns)
        self.sets = FrameSetQueue(frames, common_clock, synchroniser, lambda: self.now_ns)
        self.tracking = TrackingSession(RIG, default_plan(optimizer=cma.Settings(generations=2), **parts))
        self.tracker_health = TrackerHealth(self.health, self.sets, self.clock)
        self.live = LiveTracker(
            self.tracking,
            self.sets,
            EstimatePublisher(self.bus, self.headers, "sheet", "nurbs", RIG.calib_id, view_hz),
            self.tracker_health,
            self.clock,
            self.clocks,
            budget_ms,
        )
        self.published = Counter()
        self.lost = set()  # exposures that the bus loses

    def clock(self):
        """Time passes whenever the tracker looks at it."""
        self.now_ns += self.tick_ns
        return self.now_ns

    def expose(self, k, change=lambda frame: frame, kinds=tuple(Kind)):
        """Publishes exposure k, which has just been taken."""
        self.now_ns = max(self.now_ns, SIMULATION.time_ns(k))
        for taken in SIMULATION.expose(k)[0]:
            if taken.kind in kinds:
                frame = change(dataclasses.replace(taken, t_arrival_ns=self.now_ns))
                topic = keys.image(*frame.key)
                header = self.capture.at(frame.t_host_ns, self.published[topic])
                self.published[topic] += 1
                if k not in self.lost:
                    publisher = self.bus.publisher(topic, codec.IMAGE_SCHEMA, IMAGES)
                    publisher.put(codec.encode_image(frame, 0), codec.encode_info(frame, header))

    def sent(self, topic, message):
        return [message.FromString(sample.payload) for sample in self.bus.sent if sample.topic == topic]

    @property
    def states(self):
        return self.sent("sheet/state", DeformationState)

    @property
    def said(self):
        """The last health."""
        self.tracker_health.report()
        self.health.publish()
        return self.sent("health/track/sheet", Message)[-1]
