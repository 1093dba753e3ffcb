"""Faults of other programs on the bus: messages that no rig sends, and subscribers that stand still."""

import math
import random
import signal
import subprocess
import sys
import time
from functools import partial

from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS
from abs_service.bus.session import BusError, SessionMode, open_session
from abs_service.bus.zenoh_bus import ZenohBus
from evaluation.service.faults.fault import Fault, Made
from evaluation.service.faults.listener import DEPTH
from evaluation.service.faults.running import NAME, RunningRig
from evaluation.service.live.rig import STREAMS, TRACKER
from evaluation.service.live.subscriber import connect

#: Messages on every key, and on the one key that is flooded.
GARBAGE, FLOOD = 20, 5000
#: For how long a subscriber is stopped, and several, which is longer than their lease [s].
STOP_S, LONG_STOP_S = 3.0, 6.0
#: Subscribers of everything, as applications of another host would be: without shared memory, sockets fill.
SUBSCRIBERS = """
import sys, time
from abs_service.bus.session import SessionMode, open_session
sessions = [open_session(sys.argv[1], SessionMode.CLIENT, shared_memory=False) for _ in range(int(sys.argv[3]))]
subscribers = [session.declare_subscriber(f"abs/{sys.argv[2]}/**", lambda sample: None) for session in sessions]
time.sleep(600)
"""


def topics() -> list[str]:
    """All topics on which the rig sends."""
    sensors = [topic for sensor, _ in STREAMS for topic in (keys.model(sensor), keys.calibration(sensor))]
    images = [keys.image(sensor, stream) for sensor, stream in STREAMS]
    tracker = [keys.state(TRACKER), keys.mesh(TRACKER), keys.topology(TRACKER), keys.reinitialize(TRACKER)]
    health = [keys.health(name) for name in ("capture", f"track/{TRACKER}", "record", "run")]
    return [*dict.fromkeys(sensors), *images, *tracker, *health, keys.CONFIG, keys.TRANSFORMS, keys.truth("sim")]


def garbage(rig: RunningRig) -> Made:
    """Random bytes, of every message type of the rig, on every key."""
    draw = random.Random(rig.now_ns())
    types = ["", "absmsg.v1.Health", "absmsg.v1.DeformationState", "absmsg.v1.SensorModel", "foxglove.RawImage"]
    bus, begin_ns = connect(rig.endpoint, NAME), rig.now_ns()
    for topic in topics():
        for message in types:
            publisher = bus.publisher(topic, message, EVENTS)
            for _ in range(GARBAGE // len(types)):
                publisher.put(draw.randbytes(draw.randrange(200)), draw.randbytes(draw.randrange(60)))
    return _left(rig, bus, begin_ns)


def flood(rig: RunningRig) -> Made:
    """Valid health of no component, more than any process sends."""
    bus, begin_ns = connect(rig.endpoint, NAME), rig.now_ns()
    publisher = bus.publisher(keys.health("flood"), Health.DESCRIPTOR.full_name, EVENTS)
    message = Health(component="flood", level=Health.LEVEL_OK).SerializeToString()
    for _ in range(FLOOD):
        publisher.put(message)
    return _left(rig, bus, begin_ns)


def forged_epoch(rig: RunningRig) -> Made:
    """One depth image of an epoch far ahead."""
    image = rig.listener.last_image
    info = FrameInfo.FromString(image.attachment)
    info.epoch = 2**32 - 1
    bus, begin_ns = connect(rig.endpoint, NAME), rig.now_ns()
    bus.publisher(DEPTH, image.message, EVENTS).put(image.payload, info.SerializeToString())
    return _left(rig, bus, begin_ns)


def stopped_subscribers(rig: RunningRig, number: int, stop_s: float) -> Made:
    """Stops `number` subscribers of everything, and kills them in the end."""
    arguments = [sys.executable, "-c", SUBSCRIBERS, rig.endpoint, NAME, str(number)]
    with subprocess.Popen(arguments) as subscribers:
        time.sleep(STOP_S)  # until they have subscribed
        begin_ns, broken = rig.now_ns(), ""
        subscribers.send_signal(signal.SIGSTOP)
        time.sleep(stop_s)
        try:
            open_session(rig.endpoint, SessionMode.CLIENT, shared_memory=False).close()
        except BusError as error:
            broken = str(error)
        subscribers.kill()
        return Made(begin_ns, rig.now_ns(), broken)


def _left(rig: RunningRig, bus: ZenohBus, begin_ns: int) -> Made:
    time.sleep(0.2)  # until it is sent
    bus.close()
    return Made(begin_ns, rig.now_ns())


FAULTS = (
    Fault(f"garbage: {GARBAGE} messages of random bytes on every key", "no process ends; refused, counted", garbage),
    Fault(f"{FLOOD} valid messages at once on one key", "no process ends; refused beyond 1000 a second", flood),
    Fault(
        "a depth image of an epoch far ahead",
        "estimates go on after 30 frames",
        forged_epoch,
        estimates_s=2.0,
        noticed_s=math.inf,
    ),
    Fault(
        f"a subscriber of everything is stopped for {STOP_S:g} s",
        "nobody waits for it",
        partial(stopped_subscribers, number=1, stop_s=STOP_S),
        noticed_s=math.inf,
    ),
    Fault(
        f"six subscribers of everything are stopped for {LONG_STOP_S:g} s",
        "nobody waits for them; others can connect",
        partial(stopped_subscribers, number=6, stop_s=LONG_STOP_S),
        noticed_s=math.inf,
    ),
)
