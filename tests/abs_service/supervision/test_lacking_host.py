"""A process that the host has no room for is an error, with the reason in the health of `run`."""

import errno
import io

from absmsg.v1.health_pb2 import Health

from abs_service.display.terminal.lines import PlainDisplay
from abs_service.display.terminal.output import Output
from tests.abs_service.supervision.test_run_session import Bench


def test_that_a_process_cannot_be_started_stands_beside_what_follows_from_it():
    bench = Bench(PlainDisplay(Output(io.StringIO().write), Output(io.StringIO().write)))
    turns = iter(range(3))
    bench.lack = OSError(errno.EMFILE, "Too many open files")
    bench.session.run_until(lambda: next(turns, None) is None)
    bench.lack = None
    said = [Health.FromString(sample.payload) for sample in bench.bus.sent if sample.topic == "health/run"][-1]
    assert said.level == Health.LEVEL_ERROR
    assert "capture backoff: cannot be started: [Errno 24] Too many open files" in said.message
    for child in bench.supervisor.children.values():
        child.start_at_ns = 0
    bench.supervisor.poll()
    assert not any(child.lacks for child in bench.supervisor.children.values())
