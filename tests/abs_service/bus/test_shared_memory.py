"""Pools in shared memory fit into what is free of it."""

import json
import os
from types import SimpleNamespace

import pytest
import zenoh

from abs_service.bus import session
from drivers.encoding import connection
from drivers.remote.address import Address
from drivers.remote.link import open_link

MB = 1 << 20


@pytest.mark.parametrize(
    ("free", "flags", "pool"),
    [
        (20_000 * MB, 0, 30 * MB),
        (64 * MB, 0, 8 * MB),  # a container's default: four processes and what zenoh needs beside the pools
        (31 * MB, 0, 0),
        (64 * MB, os.ST_RDONLY, 0),
    ],
)
def test_the_pool_of_a_process_leaves_room_for_the_others(monkeypatch, free, flags, pool):
    status = SimpleNamespace(f_flag=flags, f_bavail=free >> 12, f_frsize=1 << 12)
    monkeypatch.setattr(os, "statvfs", lambda path: status)
    assert session.pool_bytes() == pool


def test_without_shared_memory_there_is_no_pool(monkeypatch):
    monkeypatch.setattr(connection, "SHARED_MEMORY", "/nowhere")
    assert session.pool_bytes() == 0


def test_a_rig_elsewhere_is_connected_to_without_shared_memory(monkeypatch):
    monkeypatch.setattr(connection, "SHARED_MEMORY", "/nowhere")
    configured = []
    monkeypatch.setattr(zenoh, "open", lambda config: configured.append(json.loads(str(config))))
    open_link(Address())
    assert configured[0]["transport"]["shared_memory"]["enabled"] is False
