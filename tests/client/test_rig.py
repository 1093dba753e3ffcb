"""Images, calibrations, commands and compact estimates of a rig, by what its own processes publish and answer."""

import math
import threading
from functools import partial

import numpy as np
import pytest
from abs_client import (
    NothingReceivedError,
    RangeError,
    RefusedError,
    Rig,
    Status,
    Tls,
    UnknownNameError,
    UnreachableError,
)
from abs_client.connection.received import Received
from abs_client.images import ImageError, read
from absmsg.v1.common_pb2 import Header
from absmsg.v1.sensor_model_pb2 import SensorModel
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

from abs_service.bus import keys as topics
from abs_service.bus.contract import IMAGES, STATE
from abs_service.bus.health import Health
from abs_service.bus.session import SessionMode
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.capture.requested_controls import RequestedControls
from abs_service.wire import commands, control_commands, estimate_messages
from drivers.encoding import codec
from drivers.simulated.address import parse
from tests.abs_service.capture.fake_device import adjustable
from tests.client.estimates.test_expansion import Bench
from tests.client.publishing import PERIOD_S
from tests.conftest import encrypted
from tests.waiting import repeating

POSE = np.array([[1.0, 0, 0, 0.05], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
MODEL = SensorModel(sensor="tof", width=4, height=3, fx=5, fy=6, cx=1, cy=2, lens=[0.1], T_rs=POSE.ravel())
NAMES = ("viewer", "operator")
REGION = '[trackers.sheet.region]\ntype = "seed"\n'
SIMULATION = parse("simulated://sheet?sensors=tof,color,bayer").build()


@pytest.fixture
def headers():
    return HeaderFactory("demo", WallClock())


@pytest.fixture
def rig(bus, endpoint):
    with Rig(endpoint) as rig:
        yield rig


def sample(frame):
    """A frame as it travels."""
    info = codec.encode_info(frame, Header(rig="demo"))
    return Received(f"abs/demo/{frame.sensor}/{frame.stream}/image", codec.encode_image(frame, 0), info)


@pytest.mark.parametrize("frame", SIMULATION.frames(40), ids=lambda frame: f"{frame.sensor}/{frame.stream}")
def test_an_image_of_every_kind_has_the_pixels_of_its_frame(frame):
    image = read(sample(frame))
    np.testing.assert_array_equal(image.pixels, frame.data)
    assert (image.encoding, image.info.kind, image.t_host_ns) == (frame.encoding, frame.kind, frame.t_host_ns)
    wanted = np.where(frame.data == frame.invalid, np.nan, frame.data * np.float32(frame.scale))
    np.testing.assert_array_equal(image.values, wanted)


@pytest.mark.parametrize("change", [{"encoding": "yuv"}, {"width": 3}, {"data": b"\0"}])
def test_what_is_no_image_is_told(change):
    given = {"width": 2, "height": 2, "encoding": "mono8", "data": b"\0\1\2\3"} | change
    with pytest.raises(ImageError, match=r"abs/demo/tof/depth/image: "):
        read(Received("abs/demo/tof/depth/image", RawImage(**given).SerializeToString(), b""))


def test_the_next_image_of_a_stream(bus, rig):
    frame = SIMULATION.frames(0)[0]
    images = bus.publisher(topics.image("tof", "depth"), codec.IMAGE_SCHEMA, IMAGES)
    with repeating(lambda: images.put(sample(frame).payload, sample(frame).attachment), PERIOD_S):
        np.testing.assert_array_equal(rig.image("tof", "depth").pixels, frame.data)
    with pytest.raises(NothingReceivedError):
        rig.image("tof", "amplitude", timeout_s=0.2)


def test_the_calibration_of_a_sensor(bus, rig):
    bus.answer_queries(topics.model("tof"), SensorModel.DESCRIPTOR.full_name, MODEL.SerializeToString)
    camera = rig.camera("tof")
    np.testing.assert_array_equal(camera.K, [[5, 0, 1], [0, 6, 2], [0, 0, 1]])
    np.testing.assert_array_equal(camera.T_rs, POSE)
    assert (camera.width, camera.height, camera.lens, camera.lens_model) == (4, 3, (0.1,), "brown_conrady")
    with pytest.raises(NothingReceivedError, match="'color'"):
        rig.camera("color")


@pytest.mark.parametrize(
    ("seed", "polygon"), [(None, ()), ((0, 0), ()), ((111, 133), ()), (None, ((80, 90), (160, 90), (120, 170)))]
)
def test_a_tracker_detects_its_object_anew(bus, rig, headers, seed, polygon):
    choices = []

    def act(choice):
        choices.append(choice)
        return "" if choice == commands.AS_CONFIGURED else REGION

    commands.answer_reinitialize(bus, "sheet", headers, Health(bus, "track/sheet", headers), act)
    assert rig.reinitialize("sheet", seed, polygon) == (REGION if seed or polygon else "")
    assert choices == [commands.Choice(seed, polygon)]


def test_a_refusal_is_raised_with_its_reason(bus, rig, headers):
    def act(seed):
        raise commands.RefusedError("the pixel is outside the image")

    commands.answer_reinitialize(bus, "sheet", headers, Health(bus, "track/sheet", headers), act)
    with pytest.raises(RefusedError, match="the pixel is outside the image"):
        rig.reinitialize("sheet", (9999, 0))


def test_the_recorder_records_and_waits(bus, rig, headers):
    asked = []
    commands.answer_record(bus, headers, Health(bus, "record", headers), lambda on: asked.append(on) or "")
    rig.record(True)
    rig.record(False)
    assert asked == [True, False]


def test_controls_of_a_device_are_told_and_set(bus, rig, headers):
    act = partial(RequestedControls().set, device=adjustable())
    control_commands.answer_controls(bus, "cam", headers, Health(bus, "capture", headers), act)
    before = {"exposure_s": 0.01, "auto_exposure": True, "infrared_gain": 12, "sync_role": "free"}
    assert rig.controls("cam") == before
    changed = {"exposure_s": 0.02, "auto_exposure": False, "infrared_gain": 7, "sync_role": "master"}
    assert rig.controls("cam", changed) == changed
    of_numpy = {"exposure_s": np.float32(0.03125), "auto_exposure": np.bool_(True), "infrared_gain": np.int64(9)}
    assert rig.controls("cam", of_numpy) == {**of_numpy, "sync_role": "master"}
    with pytest.raises(RangeError, match=r"^exposure_s = \[0\.01\]: must be true or false, a number or a text$"):
        rig.controls("cam", {"exposure_s": [0.01]})
    with pytest.raises(RefusedError, match=r"exposure_s = 2\.0: must be a number from 0\.001 to 0\.033 s"):
        rig.controls("cam", {"exposure_s": 2.0})


def test_a_command_that_nobody_answers_is_told(rig):
    with pytest.raises(NothingReceivedError, match="nobody answers on sheet/reinitialize"):
        rig.reinitialize("sheet")


def test_a_closed_connection_ends_its_streams_and_says_so(rig):
    states = rig.states("sheet", maximum_age_s=60.0)
    threading.Timer(0.2, rig.close).start()
    assert list(states) == []
    with pytest.raises(UnreachableError, match="was closed"):
        rig.camera("tof")


def test_a_viewer_reads_and_only_an_operator_commands(secured, keys, endpoint, headers):
    bus = secured("rig", SessionMode.ROUTER)
    bus.answer_queries(topics.model("tof"), SensorModel.DESCRIPTOR.full_name, MODEL.SerializeToString)
    commands.answer_reinitialize(bus, "sheet", headers, Health(bus, "track/sheet", headers), lambda seed: "")
    files = {name: [keys / f"{part}" for part in ("authority.pem", f"{name}.pem", f"{name}.key")] for name in NAMES}
    viewer, operator = (Rig(encrypted(endpoint), tls=Tls(*files[name])) for name in NAMES)
    with viewer, operator:
        assert viewer.camera("tof").width == operator.camera("tof").width == 4
        with pytest.raises(NothingReceivedError):
            viewer.reinitialize("sheet")
        assert operator.reinitialize("sheet") == ""
    with pytest.raises(UnreachableError):
        Rig(encrypted(endpoint))


def test_the_processes_that_live(bus, rig):
    bus.declare_liveliness("capture")
    bus.declare_liveliness("track/sheet")
    assert rig.processes() == ("capture", "track/sheet")


def test_a_certificate_that_is_not_there_is_told_without_a_try_to_connect(endpoint, tmp_path):
    with pytest.raises(UnknownNameError, match=r"viewer\.key is no file"):
        Rig(encrypted(endpoint), tls=Tls(__file__, __file__, tmp_path / "viewer.key"))


def test_a_slow_link_gives_vertices_of_theta_and_a_basis_that_was_sent_before(bus, endpoint):
    bench = Bench()
    latched = bus.latched_publisher(topics.topology("sheet"), estimate_messages.TOPOLOGY)
    latched.put(bench.topology().payload)
    publisher = bus.publisher(topics.theta("sheet"), estimate_messages.COMPACT, STATE)
    with Rig(endpoint) as rig, repeating(lambda: publisher.put(bench.compact().payload), PERIOD_S):
        state = next(one for one in rig.compact_states("sheet", math.inf) if one.status is Status.DEGRADED)
    np.testing.assert_allclose(state.vertices, bench.expected, atol=2e-6)
    assert state.reasons == ("folded",)
    assert state.faces.shape == bench.model.mesh.faces.shape
    assert np.isnan(state.theta_covariance).all()
    assert np.isnan(state.vertex_covariance).all()
