"""A ROS system that is nothing but its router, and a plain zenoh session that receives in it."""

import json
import socket

import pytest
import zenoh

pytest.importorskip("rosbags", reason="needs rosbags: make all")
pytest.importorskip("xxhash", reason="needs xxhash: make all")


@pytest.fixture
def ros_router():
    """Endpoint and session of a router as `rmw_zenohd` is one: its own, apart from the rig's."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        router = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    scouting = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
    settings = {"mode": "router", "listen": {"endpoints": [router]}, "scouting": scouting}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:
        yield router, session
