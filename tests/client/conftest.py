"""A tracker that is nothing but its messages, on a real zenoh router."""

import pytest

from tests.client.publishing import Tracker


@pytest.fixture
def bus(open_bus):
    """The router."""
    return open_bus()


@pytest.fixture
def tracker(bus):
    """A tracker that has found its object."""
    tracker = Tracker(bus, "first")
    tracker.remesh()
    return tracker
