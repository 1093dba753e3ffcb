"""Publishes depth images as points, for viewers."""

import threading
from collections import Counter
from collections.abc import Callable, Mapping

from abs_service.bus import keys
from abs_service.bus.contract import IMAGES, Bus, Publisher
from abs_service.bus.queues import LatestQueue
from abs_service.bus.stamps import WallClock
from abs_service.pairing.points import points_s, z_image
from abs_service.wire.message_header import POINTS
from abs_service.wire.viewer_messages import ViewRate, point_cloud
from calib.camera import Camera
from drivers.contract.device import Sink
from drivers.contract.frame import Frame, Kind


class PointCloudPublisher:
    """Hands everything on to another sink, and publishes some of the depth frames as points, from its own thread.

    Args:
        bus: where to publish.
        clock: gives the stamps.
        view_hz: largest rate of the points by sensor [Hz]; 0 for none.
        camera: camera of a sensor of an opened device.
        sink: takes everything.
    """

    def __init__(
        self, bus: Bus, clock: WallClock, view_hz: Mapping[str, float], camera: Callable[[str], Camera], sink: Sink
    ) -> None:
        self._bus = bus
        self._clock = clock
        self._view_hz = view_hz
        self._camera = camera
        self._sink = sink
        self.on_truth, self.on_state, self.on_warning = sink.on_truth, sink.on_state, sink.on_warning
        self._rates: dict[str, ViewRate] = {}
        self._publishers: dict[str, Publisher] = {}
        self._refused: Counter[str] = Counter()
        self._queue: LatestQueue[Frame] = LatestQueue(1)
        self._thread = threading.Thread(target=self._run, name="points", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> Mapping[str, int]:
        """Frames that were due and not published, because publishing fell behind or their camera does not fit."""
        return self._refused + Counter(self._queue.dropped)

    def on_frame(self, frame: Frame) -> None:
        """See `drivers.contract.device.Sink.on_frame`."""
        self._sink.on_frame(frame)
        if frame.kind != Kind.DEPTH:
            return
        topic = keys.points(keys.image(frame.sensor, frame.stream))
        if self._rates.setdefault(topic, ViewRate(self._view_hz[frame.sensor])).due(frame.t_host_ns):
            self._queue.put(topic, frame)

    def close(self) -> None:
        """Publishes the queued clouds and ends the thread; may be called again."""
        self._queue.close()
        self._thread.join()

    def _run(self) -> None:
        while (entry := self._queue.take()) is not None:
            topic, frame = entry
            try:
                cloud = self._cloud(frame)
            except Exception:  # a tracker of this sensor, or who publishes the frame, says what is wrong
                self._refused[topic] += 1
                continue
            if topic not in self._publishers:
                self._publishers[topic] = self._bus.publisher(topic, POINTS, IMAGES)
            self._publishers[topic].put(cloud)

    def _cloud(self, frame: Frame) -> bytes:
        camera = self._camera(frame.sensor)
        points = points_s(z_image(frame, camera), camera)
        return point_cloud(frame.sensor, self._clock.wall(frame.t_host_ns), points).SerializeToString()
