"""Damaged messages on every topic: each is refused at the edge, or everybody behind it can read it."""

import time

import pytest
from google.protobuf.message import Message

from abs_service.bus import keys
from abs_service.bus.contract import Sample
from abs_service.supervision.health.rig_state import RigState
from abs_service.wire.edge import Edge
from drivers.contract.text import printable
from tests.abs_service.wire.hostile import INFO, VALID
from tests.fuzzing.test_files import SECONDS, damaged, search


@pytest.mark.timeout(300 + 2 * SECONDS)
@pytest.mark.parametrize("topic", VALID)
def test_a_damaged_message_is_refused_or_can_be_read(topic: str) -> None:
    valid: Message = VALID[topic]
    state = RigState(("sheet",), time.monotonic_ns)
    info = INFO.SerializeToString() if keys.is_image(topic) else b""

    def check(data: bytes) -> None:
        edge = Edge(lambda: 0)  # one each, or those beyond a thousand a second would be refused unread
        sample = Sample(topic, valid.DESCRIPTOR.full_name, data, info)
        if edge.admits(sample):
            type(valid).FromString(data)
            state.take(sample)
        else:
            assert sum(edge.refused.values()) == 1
            assert edge.last_error == printable(edge.last_error)
        assert not state.malformed

    search(damaged(valid.SerializeToString()), check)
