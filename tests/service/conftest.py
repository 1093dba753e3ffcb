"""A real zenoh router on a free port of the loopback interface, and clients of it."""

import pytest

from abs_service.bus.session import Role
from abs_service.bus.zenoh_bus import ZenohBus


@pytest.fixture
def open_bus(endpoint):
    """Opens buses of the rig "demo"; the first is the router. All are closed after the test."""
    opened = []

    def open_bus():
        opened.append(ZenohBus.open("demo", endpoint, Role.CLIENT if opened else Role.ROUTER))
        return opened[-1]

    yield open_bus
    for bus in reversed(opened):
        bus.close()
