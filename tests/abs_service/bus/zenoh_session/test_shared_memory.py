"""Pools in shared memory fit into what is free of it."""

import os
import resource
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from abs_service.bus import session, zenoh_bus
from abs_service.bus.contract import IMAGES
from abs_service.bus.zenoh_session import shared_memory
from abs_service.bus.zenoh_session.shared_memory import may_be_locked
from tests.waiting import eventually, repeating

MB = 1 << 20


@pytest.fixture(autouse=True)
def unlimited(monkeypatch):
    monkeypatch.setattr(shared_memory, "may_be_locked", lambda: True)


@pytest.mark.parametrize(
    ("free", "flags", "pool"),
    [
        (20_000 * MB, 0, 32 * MB),
        (64 * MB, 0, 8 * MB),  # a container's default: four processes and what zenoh needs beside the pools
        (31 * MB, 0, 0),
        (64 * MB, os.ST_RDONLY, 0),
    ],
)
def test_the_pool_of_a_process_leaves_room_for_the_others(monkeypatch, free, flags, pool):
    status = SimpleNamespace(f_flag=flags, f_bavail=free >> 12, f_frsize=1 << 12)
    monkeypatch.setattr(os, "statvfs", lambda path: status)
    assert session.pool_bytes() == (pool + os.getpid() if pool else 0)


@pytest.mark.parametrize(
    ("highest", "capabilities", "users", "allowed"),
    [
        (resource.RLIM_INFINITY, 0, "1000 1000 1", True),
        (64 * MB, 1 << 14, "0 0 4294967295", True),
        (64 * MB, 1 << 13, "0 0 4294967295", False),  # a reader could map two pools, and would lose the third's images
        (64 * MB, 1 << 14, "0 1000 1", False),  # "root" of a container that a user runs
        (64 * MB, 1 << 14, "", False),
        (800 * MB, 0, "0 1000 1", True),
        (780 * MB, 0, "0 1000 1", False),
    ],
)
def test_shared_memory_is_used_only_where_it_may_be_locked_again_and_again(
    monkeypatch, tmp_path, highest, capabilities, users, allowed
):
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (8 * MB, highest))
    limits = []
    monkeypatch.setattr(resource, "setrlimit", lambda kind, limit: limits.append(limit))
    (tmp_path / "status").write_text(f"Name:\tpython\nCapEff:\t{capabilities:016x}\n")
    (tmp_path / "uid_map").write_text(f"    {users}\n")
    monkeypatch.setattr(shared_memory, "PROCESS", tmp_path)
    monkeypatch.setattr(shared_memory, "FOLDER", tmp_path)
    with (tmp_path / "7.zenoh").open("wb") as segment:
        segment.truncate(500 * MB)  # which a restarted process may have left
    assert may_be_locked() is allowed
    assert limits == [(highest, highest)]


def test_where_memory_may_not_be_locked_there_is_no_pool(monkeypatch):
    monkeypatch.setattr(shared_memory, "may_be_locked", lambda: False)
    assert session.pool_bytes() == 0


def test_without_shared_memory_there_is_no_pool(monkeypatch):
    monkeypatch.setattr(shared_memory, "FOLDER", Path("/nowhere"))
    assert session.pool_bytes() == 0


@pytest.mark.parametrize(
    ("shared", "copy"),
    [
        (None, b"sent"),
        (SimpleNamespace(is_valid=lambda: True), b"sent"),
        (SimpleNamespace(is_valid=lambda: False), None),
    ],
    ids=["sockets", "shared", "given away"],
)
def test_what_was_overwritten_before_it_was_copied_is_no_message(shared, copy):
    payload: Any = SimpleNamespace(to_bytes=lambda: b"sent", as_shm=lambda: shared)
    assert shared_memory.copied(payload) == copy


def test_a_bus_passes_no_byte_on_of_what_was_overwritten(open_bus, monkeypatch):
    monkeypatch.setattr(zenoh_bus, "copied", lambda payload: None)
    arrived = []
    open_bus().subscribe("tof/depth/image", arrived.append)
    publisher = open_bus().publisher("tof/depth/image", "foxglove.RawImage", IMAGES)
    with repeating(lambda: publisher.put(b"pixels"), 0.01):
        assert eventually(lambda: arrived)
    assert (arrived[0].payload, arrived[0].overwritten) == (b"", True)
