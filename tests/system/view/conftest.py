"""A port for the page."""

import socket

import pytest


@pytest.fixture
def port():
    """A free port."""
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        return unused.getsockname()[1]
