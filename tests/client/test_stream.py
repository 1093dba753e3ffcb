"""Taking items one at a time, in a loop and in a task, while others work and close."""

import asyncio
import threading
from typing import Any

import pytest
from abs_client import NothingReceivedError
from abs_client.connection.wake import Wake
from abs_client.stream import Stream

LIMIT_S = 5.0


class Numbers:
    """A source that always has the next number, as one has whose reader is slow; none from `end` on."""

    def __init__(self, end=10**9):
        self._next, self._end, self.skipped = 0, end, 0

    def take(self):
        if self._next == self._end:
            return None
        self._next += 1
        return self._next - 1

    def due_s(self):
        return LIMIT_S


class OpenLink:
    """A connection that stays."""

    closed = False

    def wake_at_end(self, wake):
        pass


def stream_of(source, wake=None):
    link: Any = OpenLink()
    return Stream(source, wake or Wake(), link, lambda: None)


def test_what_is_there_is_given_without_any_time_to_wait():
    numbers = stream_of(Numbers(2))
    assert [numbers.next(0.0), numbers.next(0.0)] == [0, 1]
    with pytest.raises(NothingReceivedError, match="within 0 s"):
        numbers.next(0.0)


def test_one_that_waits_for_a_stream_that_is_closed_is_told_so():
    numbers = stream_of(Numbers(0))
    threading.Timer(0.1, numbers.close).start()
    with pytest.raises(NothingReceivedError, match="was closed"):
        numbers.next(LIMIT_S)


def test_other_tasks_go_on_beside_a_task_whose_stream_always_has_an_item():
    async def read(given):
        async for number in stream_of(Numbers(10**5)):
            given.append(number)

    async def read_for_a_while():
        given = []
        reading = asyncio.create_task(read(given))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
        return given

    assert 1 <= len(asyncio.run(read_for_a_while())) < 10


def test_a_task_that_is_cancelled_loses_no_item():
    async def read():
        numbers, given = stream_of(Numbers(100)), []
        while len(given) < 100:
            taking = asyncio.ensure_future(anext(numbers))
            await asyncio.sleep(0)
            taking.cancel()
            done = (await asyncio.gather(taking, return_exceptions=True))[0]
            if isinstance(done, asyncio.CancelledError):
                done = await anext(numbers)
            given.append(done)
        return given

    assert asyncio.run(asyncio.wait_for(read(), LIMIT_S)) == [*range(100)]


@pytest.mark.parametrize("turns", range(6))
def test_a_task_that_is_cancelled_as_something_arrives_ends(turns):
    """In Python 3.11, `asyncio.wait_for` forgets a cancellation that comes together with what it waits for."""

    async def read_and_cancel():
        wake = Wake()
        reading = asyncio.ensure_future(anext(stream_of(Numbers(0), wake)))
        await asyncio.sleep(0.01)
        wake.signal()
        for _ in range(turns):
            await asyncio.sleep(0)
        reading.cancel()
        await asyncio.wait([reading], timeout=0.2)
        return reading.cancelled()

    assert asyncio.run(read_and_cancel())
