import threading

from abs_service.bus.queues import BoundedQueue, LatestQueue


def test_latest_keeps_the_newest_of_every_key_in_order_of_arrival():
    queue = LatestQueue[int](2)
    for number in range(5):
        queue.put("fast", number)
    queue.put("slow", 10)
    queue.put("fast", 5)
    assert [queue.take(0) for _ in range(4)] == [("fast", 4), ("slow", 10), ("fast", 5), None]
    assert queue.dropped == {"fast": 4}


def test_bounded_refuses_the_newcomer_and_counts_it():
    queue = BoundedQueue[str](100)
    for name in "abc":
        queue.put(name, name, 40)
    assert (queue.size, queue.dropped) == (80, {"c": 1})
    assert queue.take(0) == "a"
    queue.put("d", "d", 60)
    assert [queue.take(0), queue.take(0), queue.take(0)] == ["b", "d", None]


def test_closing_wakes_the_reader_and_lets_it_drain():
    for queue, put in (
        (latest := LatestQueue[int](2), lambda: latest.put("a", 1)),
        (bounded := BoundedQueue[int](9), lambda: bounded.put("a", 1, 1)),
    ):
        taken = []

        def read(queue=queue, taken=taken):
            while (item := queue.take()) is not None:
                taken.append(item)

        put()
        reader = threading.Thread(target=read)
        reader.start()
        queue.close()
        reader.join(5)
        assert not reader.is_alive()
        put()
        assert len(taken) == 1
        assert queue.take(0) is None


def test_no_item_is_lost_or_doubled_between_threads():
    queue = LatestQueue[int](1000)
    writers = [
        threading.Thread(target=lambda base=base: [queue.put(str(base), base + i) for i in range(500)])
        for base in (0, 1000, 2000)
    ]
    for writer in writers:
        writer.start()
    taken = [queue.take(5) for _ in range(1500)]
    for writer in writers:
        writer.join()
    assert sorted(item[1] for item in taken if item) == [*range(500), *range(1000, 1500), *range(2000, 2500)]
