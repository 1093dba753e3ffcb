"""A ROS system that is nothing but its router, and a plain zenoh session that receives in it."""

import json
from importlib.util import find_spec

import pytest
import zenoh

from tests.ports import free_endpoint

MISSING = [name for name in ("rosbags", "xxhash") if find_spec(name) is None]
#: Without the client's extra there is nothing here to test; `make all` installs it, so CI always has it.
collect_ignore_glob = ["test_*.py"] if MISSING else []


@pytest.fixture
def ros_router():
    """Endpoint and session of a router as `rmw_zenohd` is one: its own, apart from the rig's."""
    router = free_endpoint()
    scouting = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
    settings = {"mode": "router", "listen": {"endpoints": [router]}, "scouting": scouting}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(settings))) as session:
        yield router, session
