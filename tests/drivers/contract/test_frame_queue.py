"""The queue between an SDK's threads and a driver's own."""

from drivers.contract.frame_queue import FrameQueue


def test_a_frame_queue_keeps_the_newest_and_counts_drops() -> None:
    queue: FrameQueue[int] = FrameQueue(2)
    for number in range(5):
        queue.put(number)
    queue.end("over")
    assert queue.ended() == ""
    assert [queue.take(0), queue.take(0), queue.take(0)] == [3, 4, None]
    assert (queue.dropped(), queue.dropped(), queue.ended()) == (3, 0, "over")
