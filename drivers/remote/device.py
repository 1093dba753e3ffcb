"""A remote rig as a device: unchanged frames, with host times mapped to this host's clock."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from calib.camera import Camera
from drivers.contract.capabilities import Capabilities, ClockInfo
from drivers.contract.clock import DeviceClock, stream_gauges
from drivers.contract.controls import Controls
from drivers.contract.device import DeviceInfo, DeviceState, Sink
from drivers.contract.frame import Frame
from drivers.contract.frame_gate import FrameGate
from drivers.encoding import codec
from drivers.encoding.message_check import LARGEST_GAP
from drivers.encoding.parsing import CodecError
from drivers.remote.link import Link
from drivers.remote.probe import IMAGES, RemoteRig

TRUTHS = "*/truth"
#: The remote host's monotonic clock.
CLOCK = ClockInfo("remote host", 1e9)


@dataclass(slots=True)
class _Stream:
    """State of one stream: epoch in the remote rig and in this device, latest sequence number, clock mapping."""

    theirs: int
    ours: int
    seq: int
    clock: DeviceClock


class RemoteDevice:
    """Delivers the frames of another `abs-service capture`. Sequence numbers, ticks and settings are unchanged.

    If both processes share a clock, host times are unchanged; else each stream's host times are mapped from the remote
    host's clock by `drivers.contract.clock`. Each remote epoch is one epoch here. The end of the remote process is the
    state FAILED.

    Args:
        uri: address that reopens it.
        rig: name of the remote rig.
        link: zenoh link; closed with the device.
        remote: cameras and streams of the rig.
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
        """`frames` delivered; `missing` exposures, by gaps in sequence numbers; `malformed` messages."""
        return self._gate.counters

    @property
    def gauges(self) -> Mapping[str, float]:
        """Clock mapping of each stream, see `drivers.contract.clock.DeviceClock.gauges`."""
        streams = {} if self._same_clock else dict(self._streams)
        return stream_gauges((key, one.clock) for key, one in streams.items())

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
        # Truths first: a mesh is made from the first images and their truth, which is published just before them.
        self._link.subscribe(self._rig, TRUTHS, self._on_truth)
        self._link.subscribe(self._rig, IMAGES, self._on_image)
        self._link.watch_liveliness(self._rig, self._on_gone)
        if stop.is_set():
            self._link.unsubscribe()

    def stop(self) -> None:
        """Stops delivery; the sink is not called after it returns."""
        self._gate.end("stopped")
        self._link.unsubscribe()

    def close(self) -> None:
        """Stops and closes the session."""
        self._gate.release()
        self._link.close()

    def _on_gone(self) -> None:
        self._gate.report_state(DeviceState.FAILED, f'the capture of rig "{self._rig}" has ended')

    def _on_truth(self, topic: str, payload: bytes, attachment: bytes) -> None:
        # With mapped host times, no frame has exactly the time of a truth.
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
        if not self._gate.knows(frame):
            self._gate.deliver(frame)  # which counts it
            return
        stream = self._follow(frame)
        if self._same_clock:
            self._gate.deliver(replace(frame, epoch=stream.ours, host_clock=""))
            return
        stamp = stream.clock.stamp(frame.t_arrival_ns, t_arrival_ns)
        if stamp.stepped:
            self._gate.begin_epoch()
            stream.ours = self._gate.epoch
        t_host_ns = min(stamp.t_host_ns + frame.t_host_ns - frame.t_arrival_ns, t_arrival_ns)
        sigma_ns = round(math.hypot(frame.t_sigma_ns, stamp.t_sigma_ns))
        self._gate.deliver(
            replace(
                frame,
                epoch=stream.ours,
                t_host_ns=t_host_ns,
                t_arrival_ns=t_arrival_ns,
                t_sigma_ns=sigma_ns,
                host_clock="",
            )
        )

    def _follow(self, frame: Frame) -> _Stream:
        """State of the frame's stream, updated by the frame; counts missing exposures."""
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
        elif 0 < frame.seq - stream.seq <= LARGEST_GAP:
            self._gate.drop("missing", frame.seq - stream.seq - 1)
        stream.seq = frame.seq
        return stream
