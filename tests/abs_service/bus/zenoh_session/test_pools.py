"""Memory of the pools of ended processes."""

import os
import threading
from contextlib import nullcontext
from pathlib import Path

import pytest

from abs_service.bus.zenoh_session import pools
from abs_service.bus.zenoh_session.pools import READ_NS, UNIT_BYTES, EndedPools, free_pool, own_size


def test_a_pool_of_this_process_tells_whose_it_is():
    assert own_size(30 << 20) == (28 << 20) + os.getpid()
    assert own_size(UNIT_BYTES) == UNIT_BYTES + os.getpid()
    assert own_size(UNIT_BYTES - 1) == 0


@pytest.fixture
def held():
    """Files in shared memory that this process holds open: makes one of a size, filled."""
    files = []

    def make(size: int, name: str) -> Path:
        path = Path(f"/dev/shm/abs-test-{os.getpid()}-{name}.zenoh")
        file = path.open("w+b")
        files.append((path, file))
        file.write(b"x" * size)
        file.flush()
        return path

    yield make
    for path, file in files:
        file.close()
        path.unlink(missing_ok=True)


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="there is no shared memory")
def test_the_memory_of_an_ended_process_is_given_back_and_no_other(held):
    of_ended, of_other, small = held(UNIT_BYTES + 12_345, "a"), held(UNIT_BYTES + 12_346, "b"), held(12_345, "c")
    free_pool(12_345)
    assert of_ended.stat().st_blocks == 0
    assert of_ended.stat().st_size == UNIT_BYTES + 12_345, "whoever reads in it gets zeros and no SIGBUS"
    assert of_ended.read_bytes()[:3] == bytes(3)
    assert of_other.read_bytes().count(b"x") == UNIT_BYTES + 12_346
    assert small.read_bytes().count(b"x") == 12_345


def test_a_pool_is_freed_some_time_after_its_process_has_ended_and_once():
    now_ns, freed = [0], []
    pools = EndedPools(lambda: now_ns[0], freed.append)
    pools.update({1, 2})
    pools.update({2, 3})
    now_ns[0] = READ_NS - 1
    pools.update({2, 3})
    assert freed == []
    now_ns[0] = 3 * READ_NS
    pools.update({2, 3})
    pools.update({2, 3})
    assert freed == [1]


def test_a_process_that_got_the_number_of_an_ended_one_keeps_its_pool():
    now_ns, freed = [0], []
    pools = EndedPools(lambda: now_ns[0], freed.append)
    for running in ({1}, set[int](), {1}):
        pools.update(running)
    now_ns[0] = 3 * READ_NS
    pools.update({1})
    assert freed == []


@pytest.mark.skipif(not os.access("/dev/shm", os.W_OK), reason="there is no shared memory")
@pytest.mark.parametrize("whose", [0, 1])
def test_a_pool_that_another_program_deletes_ends_its_process_and_no_other(held, monkeypatch, whose):
    monkeypatch.setattr(pools, "CHECK_S", 0.01)
    path, end = held(UNIT_BYTES + os.getpid() + whose, "a"), threading.Event()
    expected = nullcontext() if whose else pytest.raises(pools.DeletedError, match="RemoveIPC")
    with expected, pools.watched(end.set):
        assert not end.wait(0.1)
        path.unlink()
        assert end.wait(0.2 if whose else 10) is not bool(whose)
