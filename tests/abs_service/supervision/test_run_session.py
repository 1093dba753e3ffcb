import io
import signal
import threading
import time
from pathlib import Path

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import MeshTopology
from absmsg.v1.health_pb2 import Health

from abs_service.bus import keys
from abs_service.bus.contract import EVENTS
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.display.terminal.lines import PlainDisplay
from abs_service.display.terminal.output import Output
from abs_service.supervision.children.child import Child
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.health import rig_view
from abs_service.supervision.health.rig_view import RigPlaces
from abs_service.supervision.limits import Limits
from abs_service.supervision.run_session import Renewal, RunSession
from abs_service.supervision.supervisor import Supervisor
from abs_service.tracking.monitors import silence_monitor
from abs_service.wire import commands, estimate_messages
from abs_service.wire.checked_bus import CheckedBus
from tests.abs_service.bus.loopback import LoopbackBus
from tests.abs_service.supervision.children.idle_process import Idle

RIG = """
version = 1
name = "bench"
bus.endpoint = "{endpoint}"
record = {{ directory = "takes", minimum_free_bytes = 0 }}
[devices.sim]
uri = "simulated://sheet?seed=1&tof=32x24&sensors=tof"
[sensors.tof]
device = "sim"
"""


@pytest.fixture
def rig_file(tmp_path, endpoint):
    """A small rig that only records, on an address of its own."""
    path = tmp_path / "rig.toml"
    path.write_text(RIG.format(endpoint=endpoint))
    return path


class Bench:
    """A session around processes that do nothing, one of which may end; none is started while the host has a lack."""

    def __init__(self, display, trackers=(), captured_at=""):
        self.bus = LoopbackBus()
        self.killed = []
        self.lack: OSError | None = None
        limits = Limits(startup_ns=10**12, stall_ns=0, restarts=0)
        children = [*([] if captured_at else [Child("capture", (), 0)]), Child("record", (), 1)]
        self.supervisor = Supervisor(children, self._spawn, time.monotonic_ns, limits)
        self.session = RunSession(
            CheckedBus(self.bus, time.monotonic_ns),
            RigPlaces("bench", "tcp/127.0.0.1:1", captured_at=captured_at),
            trackers,
            self.supervisor,
            display,
            WallClock(),
        )

    def _spawn(self, component, _):
        if self.lack is not None:
            raise self.lack
        return Idle(component, self.killed)


class Gone(io.StringIO):
    """Somebody who stopped reading."""

    def write(self, text):
        raise BrokenPipeError


def test_health_of_a_child_is_a_sign_of_life_and_its_silence_is_noticed():
    bench = Bench(PlainDisplay(Output(io.StringIO().write), Output(io.StringIO().write)))
    bench.supervisor.poll()
    bench.bus.publisher(keys.health("capture"), Health.DESCRIPTOR.full_name, EVENTS).put(
        Health(component="capture").SerializeToString()
    )
    bench.session.run_until(lambda: False)  # ends because capture, once heard, is silent and has no restart left
    assert bench.supervisor.children["capture"].state == "failed"
    reported = [Health.FromString(sample.payload) for sample in bench.bus.sent if sample.topic == "health/run"]
    assert reported[-1].level == Health.LEVEL_ERROR
    assert "capture failed: needed more than 0 restarts" in reported[-1].message


def test_a_topology_that_the_network_lost_is_queried():
    bench = Bench(PlainDisplay(Output(io.StringIO().write), Output(io.StringIO().write)), trackers=["sheet"])
    asked = []

    def topology():
        asked.append(bench.session.elapsed_s)
        return MeshTopology(tracker="sheet", mesh_version=3).SerializeToString()

    bench.bus.answer_queries(keys.topology("sheet"), estimate_messages.TOPOLOGY, topology)
    state = DeformationState(tracker="sheet", mesh_version=3).SerializeToString()
    bench.bus.publisher(keys.state("sheet"), estimate_messages.STATE, EVENTS).put(state)
    bench.session.run_until(lambda: bool(asked) or bench.session.elapsed_s > 30)
    assert len(asked) == 1
    assert bench.session.view().live.missing_topologies() == []


def test_a_tracker_that_falls_silent_is_an_error_whatever_the_cause(monkeypatch):
    monkeypatch.setattr(silence_monitor, "SILENCE_NS", 100_000_000)
    bench = Bench(PlainDisplay(Output(io.StringIO().write), Output(io.StringIO().write)), trackers=["sheet"])
    state = DeformationState(tracker="sheet").SerializeToString()
    publisher = bench.bus.publisher(keys.state("sheet"), estimate_messages.STATE, EVENTS)
    publisher.put(state)
    publisher.put(state)

    def last():
        reported = [Health.FromString(sample.payload) for sample in bench.bus.sent if sample.topic == "health/run"]
        return reported[-1] if reported else Health()

    bench.session.run_until(lambda: last().level == Health.LEVEL_ERROR or bench.session.elapsed_s > 30)
    assert last().message == "track/sheet: no estimate for 0 s"
    assert bench.session.view().silent == {"sheet": "no estimate for 0 s"}
    publisher.put(state)
    bench.session.run_until(lambda: last().level == Health.LEVEL_OK or bench.session.elapsed_s > 60)
    assert last().level == Health.LEVEL_OK
    assert bench.session.view().silent == {}


def test_a_host_that_captures_and_is_silent_is_an_error_with_its_address(monkeypatch):
    monkeypatch.setattr(rig_view, "SILENT_NS", 1_500_000_000)
    shown = []
    display = PlainDisplay(Output(shown.append), Output(io.StringIO().write))
    bench = Bench(display, ["sheet"], captured_at="tcp/far:7447")

    def last():
        reported = [Health.FromString(sample.payload) for sample in bench.bus.sent if sample.topic == "health/run"]
        return reported[-1] if reported else Health()

    bench.session.run_until(lambda: bool(shown))
    assert "Waiting for capture --listen of bench at tcp/far:7447" in shown[0]
    bench.session.run_until(lambda: last().level == Health.LEVEL_ERROR or bench.session.elapsed_s > 30)
    assert "nothing comes from capture --listen at tcp/far:7447, for " in last().message
    speaks = bench.bus.publisher(keys.health("capture"), Health.DESCRIPTOR.full_name, EVENTS)
    speaks.put(Health(component="capture").SerializeToString())
    bench.session.run_until(lambda: last().level == Health.LEVEL_OK or bench.session.elapsed_s > 60)
    assert bench.session.view().capture_silence == ""
    assert last().level == Health.LEVEL_OK


def test_what_a_new_configuration_concerns_starts_again_and_capture_is_told():
    bench = Bench(PlainDisplay(Output(io.StringIO().write), Output(io.StringIO().write)))
    children = [Child("capture", (), 0), Child("record", (), 1)]
    bench.session.answer_reloads(lambda: Renewal(Path("other"), children, ("record", "view")))
    bench.supervisor.poll()
    capture, record = (child.process for child in bench.supervisor.children.values())
    commands.reload(bench.bus, HeaderFactory("bench", WallClock()), 1.0)
    # Told once the session looks at its processes; it ends because capture, which has not been heard, is given up.
    begin = bench.session.elapsed_s
    bench.session.run_until(lambda: bench.session.elapsed_s > begin + 0.2)
    assert isinstance(capture, Idle)
    assert (bench.killed, capture.woken) == (["record"], 1)
    assert bench.supervisor.children["capture"].process is capture
    assert bench.supervisor.children["record"].process is not record
    assert bench.session.view().rig.directory == Path("other")


def test_the_processes_are_stopped_also_when_the_output_is_closed():
    bench = Bench(PlainDisplay(Output(Gone().write), Output(io.StringIO().write)))
    with pytest.raises(BrokenPipeError):
        bench.session.run_until(lambda: False)
    bench.session.stop()
    assert bench.killed == ["capture", "record"]


def lines_until(stream, word):
    """Reads lines until one holds the word, and keeps reading the rest so that nobody waits for a full pipe."""
    for line in stream:
        if word in line:
            threading.Thread(target=stream.read, daemon=True).start()
            return line
    raise AssertionError(f"{word!r} was never written")


@pytest.mark.slow
@pytest.mark.realtime
def test_ctrl_c_ends_a_running_rig_in_order_and_in_time(rig_file, tmp_path, launch):
    process = launch("run", rig_file, stdout=-1)
    lines_until(process.stdout, ".mcap 1")  # recording: its size begins with a 1
    begin = time.monotonic()
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == Exit.OK
    assert time.monotonic() - begin < 5.0
    assert [path.suffix for path in (tmp_path / "takes").iterdir()] == [".mcap"]


@pytest.mark.slow
def test_what_a_child_refuses_ends_the_run_with_its_message(rig_file, launch):
    rig_file.write_text(rig_file.read_text().replace('device = "sim"', 'device = "sim"\nhead = "tov"'))
    process = launch("run", rig_file, stdout=-1)
    _, message = process.communicate(timeout=30)
    assert process.returncode == Exit.USER
    assert message.count("abs-service: error: ") == 1
    assert 'sensors.tof: device "sim" has no head "tov"; it has: tof' in message


def test_a_configuration_that_cannot_be_used_is_refused_before_anything_starts(rig_file, launch):
    rig_file.write_text(rig_file.read_text() + "colour = 1\n")
    process = launch("run", rig_file, stdout=-1)
    out, message = process.communicate(timeout=30)
    assert (process.returncode, out) == (Exit.USER, "")
    assert "sensors.tof.colour: unknown key" in message
