"""A stream of images on the bus, and its recordings."""

import queue
import signal
import threading
import time

import numpy as np
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health
from mcap.reader import make_reader

from abs_service.bus import keys
from abs_service.bus.contract import IMAGES, STATE
from abs_service.bus.session import SessionMode
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.bus.zenoh_bus import ZenohBus
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.encoding import codec

TOPIC = keys.image("tof", "depth")


class Stream:
    """Publishes noisy frames at 200 Hz from a thread and listens to the recorder's health."""

    def __init__(self, endpoint, shape=(48, 64)):
        self._clock = WallClock()
        self._headers = HeaderFactory("demo", self._clock)
        self._pixels = np.random.default_rng(1).integers(0, 65535, shape, np.uint16)
        self._stop, self._turn = threading.Event(), threading.Lock()
        self._bus = ZenohBus.open("demo", endpoint, SessionMode.ROUTER)
        self.health = queue.SimpleQueue()
        self._received, self._ended = "", ""  # boot identities of the newest recorder, and of one that ended
        self._bus.subscribe("health/record", lambda sample: self.health.put(Health.FromString(sample.payload)))
        self._published = 0
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.end()
        self._bus.close()

    def end(self):
        """Publishes nothing more, but stays connected; returns the number of frames."""
        self._stop.set()
        self._thread.join()
        return self._published

    def track(self):
        """Publishes an estimate of the tracker "sheet"."""
        publisher = self._bus.publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
        state = DeformationState(header=self._headers.now(0), tracker="sheet", status=DeformationState.STATUS_TRACKING)
        publisher.put(state.SerializeToString())

    def wait_for(self, condition):
        """The first health of the recorder that meets a condition."""
        while True:
            health = self.health.get(timeout=20)
            if health.header.boot_id == self._ended:
                continue
            self._received = health.header.boot_id
            if condition(health):
                return health

    def stop_between_frames(self, recorder):
        """Stops a recorder that is reading no frame: one that it was reading would be refused when it goes on."""
        with self._turn:
            time.sleep(0.1)
            recorder.send_signal(signal.SIGSTOP)

    def kill(self, recorder):
        """Kills the recorder; what it said before and was not yet looked at is not taken for its successor's."""
        recorder.send_signal(signal.SIGKILL)
        recorder.wait()
        self._ended = self._received

    def _run(self):
        publisher = self._bus.publisher(TOPIC, codec.IMAGE_SCHEMA, IMAGES)
        while not self._stop.wait(0.005):
            with self._turn:
                self._publish(publisher)

    def _publish(self, publisher):
        t_ns, seq = self._clock.monotonic(), self._published
        frame = Frame("tof", "depth", Kind.DEPTH, self._pixels, "16UC1", t_ns, t_ns, seq, geometry=Geometry.RADIAL)
        header = self._headers.at(t_ns, seq)
        publisher.put(codec.encode_image(frame, self._clock.wall(t_ns)), codec.encode_info(frame, header))
        self._published += 1


def frames(path):
    """(sequence, log time [s]) of every frame in a recording, which must be readable by its index."""
    with path.open("rb") as stream:
        return [
            (message.sequence, message.log_time / 1e9)
            for _, _, message in make_reader(stream).iter_messages(topics=f"/{TOPIC}")
        ]
