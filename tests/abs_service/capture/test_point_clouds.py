"""Depth frames are published as points at a rate of their own; every frame goes on to the next sink."""

import dataclasses
import itertools

import numpy as np
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud

from abs_service.bus.stamps import WallClock
from abs_service.capture.point_clouds import PointCloudPublisher
from drivers.simulated.address import parse
from tests.abs_service.bus.loopback import LoopbackBus
from tests.drivers.recording_sink import RecordingSink
from tests.waiting import eventually

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&sensors=tof,color").build()
CLOCK = WallClock(monotonic=lambda: 0, wall=lambda: 10**18)


def published(view_hz, camera=lambda sensor: SIMULATION.heads[sensor].camera):
    bus, sink = LoopbackBus(), RecordingSink()
    clouds = PointCloudPublisher(bus, CLOCK, {"tof": view_hz, "color": 0.0}, camera, sink)
    frames = [frame for k in range(6) for frame in SIMULATION.frames(k)]
    due = itertools.accumulate(frame.stream == "depth" and view_hz > 0 for frame in frames)
    for frame, number in zip(frames, due):
        clouds.on_frame(frame)
        assert eventually(lambda wanted=number: len(bus.sent) + sum(clouds.dropped.values()) == wanted)
    clouds.close()
    sent = [PointCloud.FromString(sample.payload) for sample in bus.sent if sample.topic == "tof/depth/points"]
    assert sink.frames == frames
    return sent, dict(clouds.dropped)


def test_clouds_are_those_of_the_radial_distances():
    sent, dropped = published(1000.0)
    depth = [frame for k in range(6) for frame in SIMULATION.frames(k) if frame.stream == "depth"]
    assert (len(sent), dropped) == (len(depth), {})
    for cloud, frame in zip(sent, depth):
        points = np.frombuffer(cloud.data, "<f4").reshape(-1, 3)
        distance = frame.si()
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), distance[np.isfinite(distance)], rtol=1e-6)
        assert cloud.timestamp.ToNanoseconds() == 10**18 + frame.t_host_ns


def test_nothing_is_published_by_default():
    assert published(0.0) == ([], {})


def test_what_does_not_fit_its_camera_is_counted():
    other = dataclasses.replace(SIMULATION.heads["tof"].camera, width=31)
    assert published(1000.0, lambda sensor: other) == ([], {"tof/depth/points": 6})


def test_a_frame_with_which_a_driver_errs_does_not_end_the_others():
    bus, sink = LoopbackBus(), RecordingSink()
    clouds = PointCloudPublisher(bus, CLOCK, {"tof": 1000.0}, lambda sensor: SIMULATION.heads[sensor].camera, sink)
    depth = next(frame for frame in SIMULATION.frames(0) if frame.stream == "depth")
    for time_ns in (2**70, 2**70 + 10**9):
        clouds.on_frame(dataclasses.replace(depth, t_host_ns=time_ns))
        assert eventually(lambda: sum(clouds.dropped.values()) >= 1)
    assert eventually(lambda: clouds.dropped == {"tof/depth/points": 2})
    clouds.close()
