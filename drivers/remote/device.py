"""A remote rig as a device: its frames as they were, with their times on this host's clock."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, ClockInfo
from drivers.contract.clock import DeviceClock
from drivers.contract.controls import Controls
from drivers.contract.device import DeviceInfo, DeviceState, Sink
from drivers.contract.frame import Frame
from drivers.contract.frame_gate import FrameGate
from drivers.encoding import codec
from drivers.encoding.codec import CodecError
from drivers.remote.link import Link
from drivers.remote.probe import IMAGES, RemoteRig

TRUTHS = "*/truth"
#: The other host's monotonic clock, by its stamps.
CLOCK = ClockInfo("remote host", 1e9)


@dataclass(slots=True)
class _Stream:
    """Where one stream is: the epoch of its rig, its number here, and the latest exposure."""

    theirs: int
    ours: int
    seq: int
    clock: DeviceClock


class RemoteDevice:
    """Delivers what another `abs-service capture` publishes. Sequence numbers, ticks and settings stay as they are.

    Host times stay, too, if both processes read the same clock; else each stream's are mapped from the other host's
    clock by `drivers.contract.clock`. An epoch there is one here. If the other process ends, the device has FAILED.

    Args:
        uri: address that opens it again.
        rig: name of the remote rig.
        link: to it; closed with the device.
        remote: what the rig delivers.
        clock: CLOCK_MONOTONIC [ns].
    """

    def __init__(self, uri: str, rig: str, link: Link, remote: RemoteRig, clock: Callable[[], int]) -> None:
        self.info = DeviceInfo(uri, "abs-service rig", rig, link=uri.removeprefix("remote://").partition("/")[0])
        self.capabilities = Capabilities(remote.streams)
        self.cameras: Mapping[str, Camera] = remote.cameras
        self.controls = Controls()
        self._rig = rig
        self._link = link
        self._same_clock = remote.same_clock
        self._clock = clock
        self._gate = FrameGate(remote.streams, causes=["missing", "malformed"])
        self._streams: dict[tuple[str, str], _Stream] = {}

    @property
    def state(self) -> DeviceState:
        """See `drivers.contract.device.Device.state`."""
        return self._gate.state

    @property
    def counters(self) -> Mapping[str, int]:
        """`frames`; exposures that are `missing` between two that came, lost there or on the way; `malformed` ones."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Of each stream's mapping from the other host's clock, see `drivers.contract.clock.DeviceClock.gauges`."""
        streams = {} if self._same_clock else dict(self._streams)
        return {
            f"clock.{sensor}/{stream}.{name}": value
            for (sensor, stream), one in streams.items()
            for name, value in one.clock.gauges.items()
        }

    def start(self, sink: Sink) -> None:
        """Subscribes.

        Raises:
            DeviceError: the device was closed.
        """
        stop = self._gate.begin(sink, f'subscribing to rig "{self._rig}"')
        if stop is None:
            return
        self._streams = {}
        self._gate.report_state(DeviceState.STREAMING, f'rig "{self._rig}" is captured elsewhere')
        # Whoever makes a mesh of the first images needs their truth, which comes just before them.
        self._link.subscribe(self._rig, TRUTHS, self._on_truth)
        self._link.subscribe(self._rig, IMAGES, self._on_image)
        self._link.watch_liveliness(self._rig, self._on_gone)
        if stop.is_set():
            self._link.unsubscribe()

    def stop(self) -> None:
        """Ends delivery; after it returns the sink is not called again."""
        self._gate.end("stopped")
        self._link.unsubscribe()

    def close(self) -> None:
        """Stops and ends the session."""
        self._gate.release()
        self._link.close()

    def _on_gone(self) -> None:
        self._gate.report_state(DeviceState.FAILED, f'the capture of rig "{self._rig}" has ended')

    def _on_truth(self, topic: str, payload: bytes, attachment: bytes) -> None:
        # Truths of another clock would have no frame of the same time.
        if self._same_clock:
            try:
                self._gate.deliver_truth(codec.decode_truth(payload))
            except CodecError:
                self._gate.drop("malformed")

    def _on_image(self, topic: str, payload: bytes, attachment: bytes) -> None:
        t_arrival_ns = self._clock()
        try:
            frame = codec.decode(payload, attachment)
        except CodecError:
            self._gate.drop("malformed")
            return
        stream = self._follow(frame)
        if self._same_clock:
            self._gate.deliver(replace(frame, epoch=stream.ours))
            return
        stamp = stream.clock.stamp(frame.t_arrival_ns, t_arrival_ns)
        if stamp.stepped:
            self._gate.begin_epoch()
            stream.ours = self._gate.epoch
        t_host_ns = min(stamp.t_host_ns + frame.t_host_ns - frame.t_arrival_ns, t_arrival_ns)
        sigma_ns = round(math.hypot(frame.t_sigma_ns, stamp.t_sigma_ns))
        self._gate.deliver(
            replace(frame, epoch=stream.ours, t_host_ns=t_host_ns, t_arrival_ns=t_arrival_ns, t_sigma_ns=sigma_ns)
        )

    def _follow(self, frame: Frame) -> _Stream:
        """Where the frame's stream is; counts what is missing before the frame."""
        stream = self._streams.get(frame.key)
        if stream is None:
            stream = _Stream(frame.epoch, self._gate.epoch, frame.seq, DeviceClock(CLOCK))
            self._streams[frame.key] = stream
            return stream
        if stream.theirs != frame.epoch:
            siblings = [s for key, s in self._streams.items() if key[0] == frame.sensor and s.theirs == frame.epoch]
            if siblings:
                stream.ours = siblings[0].ours
            else:
                self._gate.begin_epoch()
                stream.ours = self._gate.epoch
            stream.theirs, stream.clock = frame.epoch, DeviceClock(CLOCK)
        elif frame.seq > stream.seq:
            self._gate.drop("missing", frame.seq - stream.seq - 1)
        stream.seq = frame.seq
        return stream
