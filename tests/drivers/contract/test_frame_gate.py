"""The gate of a driver warns of frames that are not of the size or encoding of their stream."""

import numpy as np
import pytest

from drivers.contract.capabilities import StreamInfo
from drivers.contract.frame import Frame, Kind
from drivers.contract.frame_gate import LATEST, MANY, FrameGate

WORDS = "head/image: images of 4×2 mono8 in place of 4×3 mono8, not used"


class Sink:
    """Counts frames, and keeps the warnings that hold."""

    def __init__(self):
        self.frames = 0
        self.warnings = {}

    def on_frame(self, frame):
        self.frames += 1

    def on_state(self, state, reason):
        pass

    def on_warning(self, condition, message):
        self.warnings[condition] = message


@pytest.fixture
def gate():
    return FrameGate([StreamInfo("head", "image", Kind.COLOR, "mono8", 4, 3, 30.0)])


def frame(rows, sensor="head"):
    return Frame(sensor, "image", Kind.COLOR, np.zeros((rows, 4), np.uint8), "mono8", 1, 1, 0)


def test_a_stream_whose_size_alternates_is_warned_of_until_all_of_its_latest_images_fit(gate):
    sink = Sink()
    gate.begin(sink, "")
    for _ in range(MANY):
        assert not sink.warnings
        gate.deliver(frame(3))
        gate.deliver(frame(2))
    assert list(sink.warnings.values()) == [WORDS]
    assert (sink.frames, gate.counters["wrong_size"]) == (MANY, MANY)
    for _ in range(LATEST):
        assert list(sink.warnings.values()) == [WORDS]
        gate.deliver(frame(3))
    assert list(sink.warnings.values()) == [""]


def test_a_few_images_of_another_size_or_of_an_unknown_stream_are_only_counted(gate):
    sink = Sink()
    gate.begin(sink, "")
    for _ in range(MANY - 1):
        gate.deliver(frame(2))
    for _ in range(LATEST):
        gate.deliver(frame(3))
        gate.deliver(frame(2, "other"))
    assert not sink.warnings
    assert (gate.counters["wrong_size"], gate.counters["unknown_stream"]) == (MANY - 1, LATEST)
