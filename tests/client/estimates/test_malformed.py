"""Messages that cannot be read are left out and counted, or told in this package's words; they end no loop."""

import numpy as np
import pytest
from abs_client import ClientError, MalformedError, Rig
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.sensor_model_pb2 import SensorModel
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

from abs_service.bus import keys as topics
from abs_service.bus.contract import IMAGES, STATE
from drivers.encoding import codec
from tests.client.messages import mesh, state, topology
from tests.client.publishing import PERIOD_S
from tests.waiting import eventually, repeating

KEY = "abs/demo/tof/depth/image"
GOOD = RawImage(width=2, height=1, encoding="16UC1", data=b"\1\0\2\0").SerializeToString()
INFO = FrameInfo(sensor="tof").SerializeToString()
SHORT = RawImage(width=2, height=1, encoding="16UC1", data=b"\1\0\2").SerializeToString()
NOTHING = b"\xff\xff\xff"


def changed(message, **fields):
    """The message with other fields."""
    for name, value in fields.items():
        setattr(message, name, value)
    return message


@pytest.fixture
def rig(bus, endpoint):
    with Rig(endpoint) as rig:
        yield rig


@pytest.mark.parametrize("broken", [(NOTHING, INFO), (GOOD, NOTHING), (SHORT, INFO)])
def test_a_malformed_image_is_left_out_and_counted(bus, rig, broken):
    publisher = bus.publisher(topics.image("tof", "depth"), codec.IMAGE_SCHEMA, IMAGES)
    with rig.images("tof", "depth") as images:
        with repeating(lambda: publisher.put(*broken), PERIOD_S):
            assert eventually(lambda: rig.malformed.get(KEY))
        publisher.put(GOOD, INFO)
        assert images.next(5.0).pixels.tolist() == [[1, 2]]
    assert set(rig.malformed) == {KEY}


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (NOTHING, r"abs/demo/tof/model: 3 bytes that are no absmsg\.v1\.SensorModel"),
        (SensorModel(sensor="tof").SerializeToString(), "'tof' has 0 numbers of a pose"),
        (SensorModel(sensor="tof", T_rs=[0.0] * 16, lens=[0.1] * 9).SerializeToString(), "a lens: 9"),
    ],
)
def test_a_calibration_that_cannot_be_read_is_told(bus, rig, answer, said):
    bus.answer_queries(topics.model("tof"), SensorModel.DESCRIPTOR.full_name, lambda: answer)
    with pytest.raises(MalformedError, match=said) as raised:
        rig.camera("tof")
    assert isinstance(raised.value, ClientError)


def test_an_answer_to_a_command_that_cannot_be_read_is_told(bus, rig):
    bus.answer_commands("record", "absmsg.v1.CommandAnswer", lambda _: NOTHING)
    with pytest.raises(MalformedError, match=r"abs/demo/record: 3 bytes that are no absmsg\.v1\.CommandAnswer"):
        rig.record(True)


BROKEN_ESTIMATES = {
    "state": [state(1, theta=[1.0, 2.0], covariance=[1.0], covariance_valid=True)],
    "mesh": [
        mesh(1, vertices=np.zeros(4)),
        mesh(1, covariance=bytes(71)),
    ],
    "topology": [
        changed(topology(), rest_vertices_f32=bytes(13)),
        changed(topology(), faces_u32=bytes(8)),
        changed(topology(), faces_u32=np.array([0, 1, 3], "<u4").tobytes()),
        changed(topology(), colors_u8=bytes(3)),
    ],
}


@pytest.mark.parametrize(
    ("topic", "message"), [(topic, message) for topic, messages in BROKEN_ESTIMATES.items() for message in messages]
)
def test_an_estimate_whose_arrays_are_none_is_left_out_and_counted(bus, rig, topic, message):
    publisher = bus.publisher(f"sheet/{topic}", message.DESCRIPTOR.full_name, STATE)
    with rig.states("sheet"), repeating(lambda: publisher.put(message.SerializeToString()), PERIOD_S):
        assert eventually(lambda: rig.malformed.get(f"abs/demo/sheet/{topic}"))
