"""Ports for processes under test."""

import socket


def free_port() -> int:
    """A port of this host on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def free_endpoint() -> str:
    """An address of this host on which nobody listens."""
    return f"tcp/127.0.0.1:{free_port()}"
