"""Newest messages of a rig, and figures of the last minute. Images and meshes come only while they are shown."""

import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Protocol, TypeVar

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health
from absmsg.v1.sensor_model_pb2 import Config, SensorModel
from google.protobuf.message import DecodeError, Message

from abs_service.bus import keys
from abs_service.bus.contract import Sample, Subscription
from abs_service.display.page import numbers
from abs_service.display.page.numbers import MINUTE_S, Numbers
from calib.camera import Camera
from drivers.contract.frame import Frame
from drivers.encoding import codec
from drivers.encoding.sensor_model import decode_camera

M = TypeVar("M", bound=Message)

#: Images that are kept of a stream, and the timeout of a query [s].
IMAGES, QUERY_S = 6, 0.2

_PATTERNS = ("health/**", keys.state("*"), keys.topology("*"), keys.model("*"), keys.CONFIG)
_MESSAGES: tuple[type[Message], ...] = (Health, DeformationState, DeformedMesh, MeshTopology, SensorModel, Config)


class Source(Protocol):
    """Tells the messages of a rig, as a bus does."""

    def subscribe(self, pattern: str, on_sample: Callable[[Sample], None]) -> Subscription:
        """Calls `on_sample` for each message on matching topics."""
        ...

    def query(self, pattern: str, timeout_s: float) -> list[Sample]:
        """All answers to a query for the topics that match."""
        ...


class Feed:
    """Collects the messages of a rig. Its methods may be called from one thread; messages arrive in another.

    Those that `status` needs may be called from any thread. Where the clock goes back, as in a recording, all that was
    collected is forgotten.

    Args:
        source: of the messages.
        clock: time [ns] from which the ages of messages are computed.

    Attributes:
        malformed: messages that could not be parsed.
    """

    def __init__(self, source: Source, clock: Callable[[], int]) -> None:
        self.malformed = 0
        self._source, self._clock = source, clock
        self._parse = {message.DESCRIPTOR.full_name: message for message in _MESSAGES}
        self._newest: dict[str, tuple[Message, float]] = {}
        self._numbers: dict[str, deque[Numbers]] = {}
        self._lost: Mapping[str, int] = {}  # by component
        self._images: dict[str, deque[tuple[Sample, float]]] = {}
        self._cameras: dict[str, Camera] = {}
        self._watching: list[Subscription] = []
        self._last_s = -float("inf")
        self._lock = threading.Lock()
        for pattern in _PATTERNS:
            source.subscribe(pattern, self._take)

    @property
    def now_s(self) -> float:
        """Time by the clock [s]."""
        return self._clock() * 1e-9

    def watch(self, wanted: bool) -> None:
        """Begins or ends receiving images and meshes."""
        if wanted and not self._watching:
            subscribe = self._source.subscribe
            self._watching = [subscribe("*/*/image", self._take_image), subscribe(keys.mesh("*"), self._take)]
        elif not wanted and self._watching:
            while self._watching:
                self._watching.pop().close()
            with self._lock:
                self._images.clear()

    def trackers(self) -> list[str]:
        """Trackers that have published estimates, by name."""
        with self._lock:
            return sorted(self._numbers)

    def newest(self, topic: str, kind: type[M]) -> tuple[M, float] | None:
        """The last message of a topic if it is of that kind, and its age [s]."""
        with self._lock:
            found = self._newest.get(topic)
        if found is None or not isinstance(found[0], kind):
            return None
        return found[0], self.now_s - found[1]

    def healths(self) -> list[tuple[Health, float]]:
        """Health of every component and its age [s], by name."""
        with self._lock:
            found = sorted((topic, *one) for topic, one in self._newest.items() if topic.startswith("health/"))
        return [(message, self.now_s - t_s) for _, message, t_s in found if isinstance(message, Health)]

    def age_s(self) -> float:
        """Time since any message but our own came [s]; infinite before the first."""
        with self._lock:
            times = [t_s for topic, (_, t_s) in self._newest.items() if topic != keys.health("view")]
        return self.now_s - max(times, default=-float("inf"))

    def numbers(self, tracker: str) -> list[Numbers]:
        """Numbers of the last minute, oldest first."""
        begin_s = self.now_s - MINUTE_S
        with self._lock:
            return [one for one in self._numbers.get(tracker, ()) if one.t_s >= begin_s]

    def topology(self, mesh: DeformedMesh) -> MeshTopology | None:
        """The topology of a mesh, asked for if it has not come; None if there is none."""
        topic = keys.topology(mesh.tracker)
        for ask in (False, True):
            for sample in self._source.query(topic, QUERY_S) if ask else ():
                self._take(sample)
            found = self.newest(topic, MeshTopology)
            if found and _belong(found[0], mesh):
                return found[0]
        return None

    def cameras(self) -> dict[str, Camera]:
        """The camera of every sensor that published one."""
        with self._lock:
            models = [one for one, _ in self._newest.values() if isinstance(one, SensorModel)]
        for model in models:
            known = self._cameras.get(model.sensor)
            if known is None or known.calib_id != model.calib_id:
                with suppress(codec.CodecError):
                    self._cameras[model.sensor] = decode_camera(model)
        return dict(self._cameras)

    def streams(self) -> list[str]:
        """Topics of the images that are there, by name."""
        with self._lock:
            return sorted(self._images)

    def frame(self, topic: str, t_host_ns: int = 0) -> tuple[Frame, float] | None:
        """A frame and its age [s]: the one nearest to the exposure `t_host_ns`, or the newest; None without any."""
        with self._lock:
            kept = list(self._images.get(topic, ()))
        if not kept:
            return None
        nearest = min(kept, key=lambda one: abs(_exposure_ns(one[0]) - t_host_ns)) if t_host_ns else kept[-1]
        try:
            return codec.decode(nearest[0].payload, nearest[0].attachment), self.now_s - kept[-1][1]
        except codec.CodecError:
            self.malformed += 1
            return None

    def image_rate_hz(self, topic: str) -> float:
        """Rate of a stream as its sender measures it [1/s]; 0 if unknown."""
        found = self.newest(keys.health("capture"), Health)
        return found[0].gauges.get(f"rate_hz.{topic}", 0.0) if found else 0.0

    def _take(self, sample: Sample) -> None:
        kind = self._parse.get(sample.message)
        if kind is None:
            return
        try:
            message = kind.FromString(sample.payload)
        except DecodeError:
            self.malformed += 1
            return
        with self._lock:
            now_s = self._arrival_s()
            self._newest[sample.topic] = message, now_s
            if isinstance(message, Health):
                self._lost = {**self._lost, message.component: numbers.losses(message)}
            if isinstance(message, DeformationState):
                length = deque[Numbers](maxlen=round(60 * MINUTE_S))
                self._numbers.setdefault(message.tracker, length).append(numbers.of_state(message, now_s, self._lost))

    def _take_image(self, sample: Sample) -> None:
        with self._lock:
            now_s = self._arrival_s()
            self._images.setdefault(sample.topic, deque(maxlen=IMAGES)).append((sample, now_s))

    def _arrival_s(self) -> float:
        """The time now [s]; forgets everything if it is earlier than that of the last message."""
        now_s = self.now_s
        if now_s < self._last_s:
            for collected in (self._newest, self._numbers, self._images):
                collected.clear()
            self._lost = {}
        self._last_s = now_s
        return now_s


def _belong(topology: MeshTopology, mesh: DeformedMesh) -> bool:
    of_topology = topology.header.boot_id, topology.mesh_version
    return of_topology == (mesh.header.boot_id, mesh.mesh_version)


def _exposure_ns(sample: Sample) -> int:
    with suppress(DecodeError):
        return FrameInfo.FromString(sample.attachment).header.t_host_ns
    return 0
