"""Round trip of frames and truths; malformed bytes raise a CodecError."""

import dataclasses
import math

import numpy as np
import pytest
from absmsg.v1.common_pb2 import Header
from absmsg.v1.frame_info_pb2 import FrameInfo
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from drivers.contract.device import Truth
from drivers.contract.frame import ENCODINGS, Frame, Geometry, Kind, Reference
from drivers.encoding import codec
from drivers.encoding.parsing import CodecError

INT64 = st.integers(-(2**63), 2**63 - 1)
TIMES = st.integers(-(2**62), 2**62)
NAMES = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,7}", fullmatch=True)
TEXT = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), max_size=8)
SETTINGS = st.floats(allow_nan=True, allow_infinity=True)


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    encoding = draw(st.sampled_from(sorted(ENCODINGS)))
    dtype, channels = ENCODINGS[encoding]
    size = draw(st.tuples(st.integers(1, 5), st.integers(1, 5)))
    shape = size if channels == 1 else (*size, channels)
    kind = draw(st.sampled_from(Kind))
    return Frame(
        sensor=draw(NAMES),
        stream=draw(NAMES),
        kind=kind,
        data=draw(hnp.arrays(dtype, shape)),
        encoding=encoding,
        t_host_ns=draw(TIMES),
        t_arrival_ns=draw(TIMES),
        seq=draw(st.integers(0, 2**62)),
        epoch=draw(st.integers(0, 2**32 - 1)),
        scale=draw(st.floats(min_value=1e-300, allow_infinity=False)),
        geometry=draw(st.sampled_from([Geometry.Z, Geometry.RADIAL] if kind == Kind.DEPTH else list(Geometry))),
        invalid=draw(st.none() | SETTINGS),
        t_device_ticks=draw(INT64),
        tick_hz=draw(st.floats(0, 1e12)),
        clock_domain=draw(TEXT),
        t_sigma_ns=draw(st.integers(0, 2**62)),
        t_reference=draw(st.sampled_from(Reference)),
        exposure_s=draw(SETTINGS),
        gain=draw(SETTINGS),
        temperature_c=draw(SETTINGS),
        modulation=draw(TEXT),
        calib_id=draw(TEXT),
        undistorted=draw(st.booleans()),
        filters=tuple(draw(st.lists(TEXT, max_size=3))),
        incomplete=draw(st.booleans()),
        saturated=draw(st.booleans()),
    )


def small_frame() -> Frame:
    depth = np.arange(6, dtype="<u2").reshape(2, 3)
    return Frame("tof", "depth", Kind.DEPTH, depth, "16UC1", 5, 6, seq=7, geometry=Geometry.RADIAL, scale=0.001)


def equal(left: object, right: object) -> bool:
    if isinstance(left, float) and isinstance(right, float) and math.isnan(left):
        return math.isnan(right)
    return left == right


@given(frames(), st.integers(0, 2**62))
def test_frames_round_trip(frame: Frame, wall_ns: int) -> None:
    image, info = codec.encode_image(frame, wall_ns), codec.encode_info(frame, Header(rig="demo", seq=3))
    back = codec.decode(image, info)
    for field in dataclasses.fields(Frame):
        sent, received = getattr(frame, field.name), getattr(back, field.name)
        if field.name == "data":
            assert received.dtype == sent.dtype
            assert received.tobytes() == sent.tobytes()
            assert not received.flags.writeable
        else:
            assert equal(sent, received), field.name


def test_raw_images_have_wall_time_and_the_sensor_as_frame_id() -> None:
    image = RawImage.FromString(codec.encode_image(small_frame(), 1_700_000_000_123_456_789))
    assert image.timestamp.ToNanoseconds() == 1_700_000_000_123_456_789
    assert (image.frame_id, image.width, image.height, image.step) == ("tof", 3, 2, 6)


def test_the_header_has_the_sender_and_the_frames_time() -> None:
    info = FrameInfo.FromString(codec.encode_info(small_frame(), Header(rig="demo", boot_id="b", seq=3, t_host_ns=99)))
    assert (info.header.rig, info.header.boot_id, info.header.seq) == ("demo", "b", 3)
    assert (info.header.t_host_ns, info.header.frame_id) == (5, "tof")


def damaged(*, image: dict[str, object] | None = None, info: dict[str, object] | None = None) -> tuple[bytes, bytes]:
    picture = RawImage.FromString(codec.encode_image(small_frame(), 0))
    about = FrameInfo.FromString(codec.encode_info(small_frame(), Header()))
    for message, changes in ((picture, image), (about, info)):
        for name, value in (changes or {}).items():
            setattr(message, name, value)
    return picture.SerializeToString(), about.SerializeToString()


@pytest.mark.parametrize(
    ("messages", "complaint"),
    [
        (damaged(image={"encoding": "yuv422"}), "encoding 'yuv422' is none of"),
        (damaged(image={"width": 4}), "has 8 bytes, step is 6"),
        (damaged(image={"height": 3}), r"needs 18 bytes .* has 12"),
        (damaged(image={"data": b""}), "has 0"),
        (damaged(image={"height": 0, "data": b""}), r"more than 0"),
        (damaged(image={"frame_id": "color"}), "the image is of sensor 'color', its info of 'tof'"),
        (damaged(info={"kind": "smell"}), "kind 'smell' is none of"),
        (damaged(info={"geometry": 9}), "geometry = 9 must be one of"),
        (damaged(info={"geometry": 0}), "must declare its geometry"),
        (damaged(info={"t_reference": 9}), "t_reference = 9 must be one of"),
        (damaged(info={"scale": 0.0}), "scale must be positive"),
        (damaged(info={"scale": math.nan}), "scale = nan must be finite"),
        (damaged(info={"tick_hz": -1.0}), "tick_hz must be 0 or more"),
        (damaged(info={"t_sigma_ns": -1}), "t_sigma_ns = -1 must be in 0 …"),
        (damaged(info={"stream": ""}), "no names of a sensor and a stream"),
        ((b"\xff\xff", codec.encode_info(small_frame(), Header())), "are no foxglove.RawImage"),
        ((codec.encode_image(small_frame(), 0), b"\x12\x01\xff"), r"are no absmsg\.v1\.FrameInfo"),
    ],
)
def test_errors_name_the_problem(messages: tuple[bytes, bytes], complaint: str) -> None:
    with pytest.raises(CodecError, match=complaint):
        codec.decode(*messages)


@given(st.data())
def test_corrupt_bytes_are_a_frame_or_a_codec_error(data: st.DataObject) -> None:
    message = bytearray(codec.encode_image(small_frame(), 1)), bytearray(codec.encode_info(small_frame(), Header()))
    for part in message:
        for _ in range(data.draw(st.integers(0, 3))):
            part[data.draw(st.integers(0, len(part) - 1))] = data.draw(st.integers(0, 255))
        del part[data.draw(st.integers(0, len(part))) :]
    try:
        frame = codec.decode(bytes(message[0]), bytes(message[1]))
    except CodecError:
        return
    assert frame.data.size > 0


@given(st.binary(max_size=64), st.binary(max_size=64))
def test_arbitrary_bytes_are_a_codec_error(image: bytes, info: bytes) -> None:
    with pytest.raises(CodecError):
        codec.decode(image, info)


GRIDS = hnp.array_shapes(min_dims=2, max_dims=2).map(lambda shape: (*shape, 3))
FINITE = st.floats(width=32, allow_nan=False, allow_infinity=False)


@given(hnp.arrays(np.float32, GRIDS, elements=FINITE), TIMES)
def test_truths_round_trip(points_r: np.ndarray, t_host_ns: int) -> None:
    back = codec.decode_truth(codec.encode_truth(Truth(4, t_host_ns, points_r, 3), Header(rig="demo")))
    assert (back.seq, back.t_host_ns) == (4, t_host_ns)
    np.testing.assert_array_equal(back.points_r, points_r)


@given(st.binary(max_size=64))
def test_arbitrary_bytes_are_not_a_truth(payload: bytes) -> None:
    with pytest.raises(CodecError):
        codec.decode_truth(payload)
