"""A stream stalls when nothing comes, and when the same image comes again and again; empty images are told."""

from dataclasses import replace

import numpy as np
import pytest

from abs_service.capture.image_check import RepeatedImages, is_empty
from abs_service.capture.stall_detector import REOPEN_NS, STALL_NS, StallDetector
from drivers.contract.capabilities import StreamInfo
from drivers.contract.device import DeviceState
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.address import parse
from tests.drivers.recording_sink import RecordingSink

PERIOD_NS = 33_333_333
STREAM = StreamInfo("head", "depth", Kind.DEPTH, "16UC1", 64, 48, 30.0)


class Camera:
    """A camera whose images the test makes; its stamps always advance."""

    def __init__(self, stream=STREAM, repeated_images=None):
        self.now_ns = 0
        self.sink = RecordingSink()
        repeated_images = repeated_images or RepeatedImages()
        self.detector = StallDetector(self.sink, {"head": "tof"}, [stream], lambda: self.now_ns, 7, repeated_images)
        self.detector.on_state(DeviceState.STREAMING, "")

    def show(self, data, periods=1, **changes):
        """The same image for some periods."""
        for _ in range(periods):
            self.now_ns += PERIOD_NS
            self.detector.on_frame(replace(image(data), t_host_ns=self.now_ns, t_arrival_ns=self.now_ns, **changes))


def image(data, invalid=0.0):
    encoding = "32FC1" if data.dtype.kind == "f" else "16UC1"
    return Frame("head", "depth", Kind.DEPTH, data, encoding, 0, 0, 0, geometry=Geometry.Z, invalid=invalid)


def noisy(seed):
    return np.random.default_rng(seed).integers(1, 5000, (48, 64)).astype("<u2")


def test_a_frozen_camera_is_stalled_then_opened_again_and_its_images_are_left_out():
    camera = Camera()
    for seed in range(3):
        camera.show(noisy(seed))
    camera.show(noisy(2), periods=STALL_NS // PERIOD_NS + 2)
    assert camera.detector.check() == (DeviceState.STALLED, "head/depth delivers the same image for 1 s")
    assert len(camera.sink.frames) == 3
    assert camera.detector.counters["repeated"] == STALL_NS // PERIOD_NS + 2
    camera.show(noisy(3))
    assert camera.detector.check()[0] is DeviceState.STREAMING
    camera.show(noisy(3), periods=REOPEN_NS // PERIOD_NS + 2)
    assert camera.detector.check() == (DeviceState.FAILED, "head/depth delivers the same image for 5 s")


def test_a_camera_that_is_frozen_when_it_is_opened_again_delivers_nothing():
    repeated_images = RepeatedImages()
    Camera(repeated_images=repeated_images).show(noisy(0))
    again = Camera(repeated_images=repeated_images)
    again.show(noisy(0), periods=3)
    assert again.sink.frames == []
    assert not again.detector.delivered


def test_a_silent_camera_is_told_from_a_frozen_one():
    camera = Camera()
    camera.show(noisy(0))
    camera.now_ns += 2 * STALL_NS
    assert camera.detector.check() == (DeviceState.STALLED, "head/depth delivers nothing for 2 s")


#: What a driver may hand over by mistake; protobuf takes some of it, and receivers would refuse that.
MISTAKES = (
    {"t_sigma_ns": -1},
    {"t_sigma_ns": float("nan")},
    {"t_host_ns": None},
    {"t_host_ns": 2**63 - 1},
    {"t_arrival_ns": -(2**62) - 1},
    {"seq": 2**63},
    {"seq": 1.5},
    {"epoch": None},
    {"scale": 0.0},
    {"scale": float("nan")},
    {"tick_hz": -1.0},
    {"exposure_s": "long"},
    {"invalid": "x"},
    {"unit": "\x1b[2J"},
    {"kind": "depth"},
    {"filters": ("\x07",)},
    {"stream": "../x"},
    {"data": np.zeros((0, 0), "<u2")},
)


@pytest.mark.parametrize("mistake", MISTAKES, ids=str)
def test_what_is_no_frame_is_left_out_counted_and_said_as_long_as_it_comes(mistake):
    camera = Camera()
    camera.show(noisy(0))
    camera.detector.on_frame(replace(image(noisy(1)), **mistake))
    assert camera.detector.take_warnings()["frames"].startswith("its driver delivers what is no frame: ")
    camera.show(noisy(2))
    assert (len(camera.sink.frames), camera.detector.counters["malformed"]) == (2, 1)
    camera.now_ns += STALL_NS
    assert camera.detector.check()[0] is DeviceState.STREAMING
    assert camera.detector.take_warnings() == {"frames": ""}


@pytest.mark.parametrize("nothing", [None, {"sensor": "head"}])
def test_a_driver_that_delivers_no_frames_at_all_is_silent_and_told_why(nothing):
    camera = Camera()
    camera.show(noisy(0))
    camera.now_ns += 2 * STALL_NS
    camera.detector.on_frame(nothing)
    state, reason = camera.detector.check()
    assert state is DeviceState.STALLED
    assert reason.startswith("head/depth delivers nothing for 2 s; its driver delivers what is no frame: ")


@pytest.mark.parametrize(
    "data",
    [noisy(0)[::-1, ::-1], np.asfortranarray(noisy(0)), np.ma.array(noisy(0)), np.broadcast_to(noisy(0)[:1], (48, 64))],
)
def test_any_memory_layout_is_delivered(data):
    camera = Camera()
    camera.show(data)
    assert len(camera.sink.frames) == 1


def test_images_without_noise_may_be_equal():
    camera = Camera(replace(STREAM, noisy=False))
    camera.show(noisy(0), periods=100)
    assert camera.detector.check()[0] is DeviceState.STREAMING
    assert len(camera.sink.frames) == 100


def test_one_pixel_makes_another_image():
    camera, data = Camera(), noisy(0)
    camera.show(data)
    changed = data.copy()
    changed[31, 43] += 1
    camera.show(changed)
    assert len(camera.sink.frames) == 2


@pytest.mark.parametrize(
    "data", [np.full((48, 64), np.nan, "<f4"), np.zeros((48, 64), "<f4"), np.zeros((48, 64), "<u2")]
)
def test_images_in_which_nothing_is_are_counted_and_told_and_are_no_stall(data):
    camera = Camera()
    camera.show(data, periods=10)
    assert camera.detector.take_warnings() == {}
    camera.show(data, periods=90)
    said = {"head/depth empty": "head/depth: nothing in its images; is it covered, or its light off?"}
    assert camera.detector.take_warnings() == said
    assert camera.detector.counters["empty"] == len(camera.sink.frames) == 100
    assert camera.detector.check()[0] is DeviceState.STREAMING
    camera.show(noisy(0))
    assert camera.detector.take_warnings() == {"head/depth empty": ""}


@pytest.mark.parametrize(("share", "reported"), [(1, False), (2, False), (3, True)])
def test_a_stream_with_far_fewer_images_than_promised_is_told_until_they_come(share, reported):
    camera = Camera()
    reported_now = show_every(camera, share, 11)
    text = "head/depth: 10.0 of 30 images a second; see its cable, its port and its exposure"
    assert reported_now == {"head/depth rate": text if reported else ""}
    assert show_every(camera, 1, 11) == {"head/depth rate": ""}


def test_a_process_that_stood_still_does_not_blame_the_camera():
    camera = Camera()
    show_every(camera, 1, 3)
    camera.now_ns += 4 * 10**9
    camera.detector.on_frame(image(noisy(1)))
    camera.now_ns += 4 * 10**9
    assert camera.detector.check()[0] is not DeviceState.FAILED
    assert show_every(camera, 1, 9) == {}
    assert show_every(camera, 1, 2) == {"head/depth rate": ""}


def show_every(camera, share, seconds):
    """One of so many images, for some seconds; the warnings."""
    warnings = {}
    for period in range(seconds * 30):
        if period % share == 0:
            camera.show(noisy(camera.now_ns), periods=1)
        else:
            camera.now_ns += PERIOD_NS
        assert camera.detector.check()[0] is DeviceState.STREAMING
        warnings |= camera.detector.take_warnings()
    return warnings


def test_an_image_with_one_measurement_is_not_empty():
    data = np.full((48, 64), np.nan, "<f4")
    data[31, 43] = 1.5
    assert not is_empty(image(data))


def test_a_black_picture_is_empty_and_a_light_barrier_never():
    black = Frame("head", "color", Kind.COLOR, np.zeros((48, 64, 3), np.uint8), "rgb8", 0, 0, 0)
    assert is_empty(black)
    assert not is_empty(replace(black, kind=Kind.BINARY, data=np.zeros((1, 1), np.uint8), encoding="mono8"))


@pytest.mark.parametrize(("noise", "varies"), [(0, False), (1, True)])
def test_a_simulation_says_whether_its_images_vary(noise, varies):
    simulation = parse(f"simulated://sheet?noise={noise}&sensors=tof&speed=0&tof=32x24").build()
    first, second = (simulation.frames(k)[0].data for k in (0, 1))
    assert simulation.noisy is varies
    assert not (varies and np.array_equal(first, second))
