"""Control protocol: commands, and valid and invalid answers."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.contract.device import DeviceError
from drivers.kinect1.camera import LINE_S, MAX_LINES, KinectCamera, Stream
from drivers.kinect1.reference_plane import ReferencePlane
from drivers.kinect1.transport.commands import ANSWER_BYTES, TIMEOUT_S, Commands, ProtocolError
from evaluation.service.kinect1_emulation.emulated_camera import EmulatedKinect


class Pipe:
    """Control endpoint of an emulated camera, with a clock that advances by sleeping."""

    def __init__(self, kinect: EmulatedKinect) -> None:
        self.kinect = kinect
        self.now_ns = 0
        self.commands = Commands(self, lambda: self.now_ns, self.sleep)
        self.camera = KinectCamera(self.commands)

    def write(self, data: bytes) -> None:
        self.kinect.request(data)

    def read(self, size: int) -> bytes:
        return self.kinect.answer(size)

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


@pytest.fixture
def pipe() -> Pipe:
    return Pipe(EmulatedKinect({}))


def test_registers_are_written_and_read(pipe: Pipe) -> None:
    pipe.commands.write_register(0x47, 9)
    assert pipe.commands.read_register(0x47) == 9


def test_late_answers_are_polled() -> None:
    pipe = Pipe(EmulatedKinect({}, polls=5))
    assert pipe.camera.infrared_gain() == 30


def test_tags_wrap_after_65536_commands(pipe: Pipe) -> None:
    for value in range(0x10000):
        pipe.commands.write_register(0x47, value)
    pipe.commands.write_register(0x47, 5)  # the emulator and the driver compare tags
    assert pipe.kinect.registers[0x47] == 5


def test_register_writes_of_starting_and_stopping_streams(pipe: Pipe) -> None:
    for stream in (Stream.DEPTH, Stream.COLOR):
        pipe.camera.start(stream)
    assert pipe.kinect.registers[0x06] == 2
    assert pipe.kinect.registers[0x12] == 3
    assert pipe.kinect.registers[0x05] == 1
    assert pipe.kinect.written[5:7] == [(0x06, 2), (0x17, 0)]
    for stream in (Stream.DEPTH, Stream.COLOR):
        pipe.camera.stop(stream)
    assert pipe.kinect.registers[0x06] == pipe.kinect.registers[0x05] == 0
    pipe.camera.start(Stream.IR)
    assert pipe.kinect.registers[0x05] == 3


@pytest.mark.parametrize("size", [322, 334])
def test_the_calibration_of_early_and_late_models_is_parsed(size: int) -> None:
    plane = Pipe(EmulatedKinect({}, fixed_size=size)).camera.reference_plane()
    assert plane.baseline == pytest.approx(0.075)
    assert plane.step == pytest.approx(ReferencePlane().step)


def test_exposure_and_automatic_modes_of_the_color_camera(pipe: Pipe) -> None:
    camera = pipe.camera
    assert camera.exposure_s() == pytest.approx(300 * LINE_S)
    camera.set_exposure_s(0.01)
    assert camera.exposure_s() == pytest.approx(0.01, abs=LINE_S / 2)
    camera.set_exposure_s(1.0)
    assert camera.exposure_s() == pytest.approx(MAX_LINES * LINE_S)
    assert camera.auto_exposure()
    assert camera.auto_white_balance()
    camera.set_auto_exposure(False)
    assert not camera.auto_exposure()
    assert camera.auto_white_balance()
    camera.set_auto_white_balance(False)
    camera.set_auto_exposure(True)
    assert pipe.kinect.color_sensor[0x106] == 0x4010
    camera.set_infrared_gain(7)
    assert pipe.kinect.registers[0x15] == 7


@pytest.mark.parametrize("nothing", [b"", bytes(ANSWER_BYTES)])
def test_no_answer_raises_after_the_timeout(pipe: Pipe, nothing: bytes) -> None:
    pipe.kinect.corrupt = lambda _: nothing
    with pytest.raises(ProtocolError, match=r"0x02 within 1 s.*power"):
        pipe.commands.read_register(0x15)
    assert pipe.now_ns == pytest.approx(TIMEOUT_S * 1e9, rel=0.05)


@pytest.mark.parametrize(
    "corrupt",
    [
        lambda answer: b"XX" + answer[2:],
        lambda answer: answer[:2] + b"\x09" + answer[3:],
        lambda answer: answer[:4] + b"\x09" + answer[5:],
        lambda answer: answer[:6] + b"\x09" + answer[7:],
        lambda answer: answer + bytes(2),
        lambda answer: answer[:5],
    ],
)
def test_an_answer_to_another_command_raises(pipe: Pipe, corrupt) -> None:
    pipe.kinect.corrupt = corrupt
    with pytest.raises(ProtocolError, match="command 0x02 with tag 0"):
        pipe.commands.read_register(0x15)


@given(st.binary(max_size=ANSWER_BYTES), st.sampled_from(["plane", "gain", "exposure", "start"]), st.booleans())
def test_arbitrary_answers_are_parsed_or_raise_a_device_error(answer: bytes, what: str, framed: bool) -> None:
    pipe = Pipe(EmulatedKinect({}))
    pipe.kinect.corrupt = lambda good: (
        good[:2] + bytes([len(answer) // 2, 0]) + good[4:8] + answer if framed else answer
    )
    actions = {
        "plane": pipe.camera.reference_plane,
        "gain": pipe.camera.infrared_gain,
        "exposure": pipe.camera.exposure_s,
        "start": lambda: pipe.camera.start(Stream.DEPTH),
    }
    with contextlib.suppress(DeviceError):
        actions[what]()
    pipe.kinect.corrupt = lambda good: good
    assert pipe.commands.read_register(0x15) == pipe.kinect.registers[0x15]  # the next command is answered
