"""Notifications to systemd, over a real datagram socket and with a clock of the test."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest
from absmsg.v1.health_pb2 import Health

from abs_service.bus.contract import Sample
from abs_service.supervision.children.child import Child
from abs_service.supervision.exit_codes import Exit
from abs_service.supervision.health import systemd
from abs_service.supervision.health.rig_state import RigState
from abs_service.supervision.health.rig_view import RigPlaces, RigView
from abs_service.tracking.log.tracker_log import EstimateReport

S = 1_000_000_000


class Manager:
    """The end of systemd: what it has received; and a rig whose time and estimates are in the test's hand."""

    def __init__(self, folder, *trackers, **environment):
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        self._socket.bind(str(folder / "notify"))
        address = {"NOTIFY_SOCKET": str(folder / "notify"), "WATCHDOG_USEC": "40000000"}
        self.notifier = systemd.notifier(address | environment)
        self.now_ns, self.children = 0, ()
        self.live = RigState(trackers, lambda: self.now_ns)

    def received(self):
        messages = []
        while True:
            try:
                messages.append(self._socket.recv(4096).decode())
            except BlockingIOError:
                return messages

    def says(self, component, **fields):
        health = Health(component=component, **fields)
        self.live.take(Sample(f"health/{component}", Health.DESCRIPTOR.full_name, health.SerializeToString()))

    def estimates(self, tracker, status="TRACKING"):
        log = self.live.trackers[tracker]
        log.estimates += 1
        log.last = EstimateReport(tracker, 0, "", status, (), (), (), None, None, None, 1.0, 1.0, 1, 1, 0)

    def after(self, seconds):
        """Messages sent until then, without the status texts."""
        self.now_ns += int(seconds * S)
        self.notifier.update(RigView(RigPlaces("demo"), self.live, self.children, 0.0, self.now_ns, ""))
        return [message for message in self.received() if not message.startswith("STATUS=")]

    def close(self):
        self._socket.close()


@pytest.fixture
def start(tmp_path):
    """Starts a manager."""
    started = []

    def start(*trackers, **environment):
        started.append(Manager(tmp_path, *trackers, **environment))
        return started[-1]

    yield start
    for manager in started:
        manager.close()


def test_a_rig_is_ready_with_the_first_estimate_of_every_tracker_and_asks_for_time_until_then(start):
    manager = start("a", "b")
    assert manager.after(0) == ["EXTEND_TIMEOUT_USEC=60000000"]
    manager.estimates("a")
    assert manager.after(14) == []
    assert manager.after(1) == ["EXTEND_TIMEOUT_USEC=60000000"]
    manager.estimates("b")
    assert manager.after(0.1) == ["READY=1", "WATCHDOG=1"]


def test_estimates_feed_the_watchdog_and_nothing_else_does(start):
    manager = start("sheet")
    manager.says("capture", counters={"published.tof/depth/image": 1})
    manager.estimates("sheet")
    assert manager.after(0) == ["READY=1", "WATCHDOG=1"]
    fed = []
    for second in range(1, 41):
        manager.estimates("sheet", "LOST")
        fed += [second for message in manager.after(1) if message == "WATCHDOG=1"]
    assert fed == [10, 20, 30, 40]
    # Images and the health of all parts go on, estimates do not.
    for second in range(60):
        manager.says("capture", counters={"published.tof/depth/image": second + 2})
        manager.says("track/sheet", level=Health.LEVEL_OK)
        assert manager.after(1) == []
    manager.estimates("sheet")
    assert manager.after(0.1) == ["WATCHDOG=1"]


def test_one_silent_tracker_is_not_hidden_by_another(start):
    manager = start("a", "b")
    manager.estimates("a")
    manager.estimates("b")
    manager.after(0)
    for _ in range(60):
        manager.estimates("a")
        assert manager.after(1) == []


def test_a_tracker_that_compiles_kernels_again_is_alive(start):
    manager = start("a", "b")
    manager.estimates("a")
    manager.estimates("b")
    assert manager.after(0) == ["READY=1", "WATCHDOG=1"]
    manager.says("track/b", labels={"phase": "preparing", "kernels": "3 of 31"})
    fed = []
    for second in range(1, 91):
        manager.estimates("a")
        fed += [second for message in manager.after(1) if message == "WATCHDOG=1"]
    assert fed == list(range(10, 91, 10))


def test_a_rig_that_waits_for_a_right_file_is_not_ended(start):
    manager = start("sheet")
    manager.says("track/sheet")
    manager.estimates("sheet")
    assert manager.after(1) == ["READY=1", "WATCHDOG=1"]
    assert not manager.after(60)
    manager.children = (Child("capture", (), 0, lacks=True, exit_code=Exit.USER),)
    assert manager.after(20) == ["WATCHDOG=1"]
    manager.children = (Child("capture", (), 0, lacks=True),)
    assert not manager.after(20), "the host lacks something, which a new start may give back"


def test_a_rig_without_trackers_lives_by_its_images(start):
    manager = start()
    assert "READY=1" not in manager.after(0)
    images = [100, 400, 400, 700, 30]  # the last one after a restart of capture
    sent = []
    for number in images:
        manager.says("capture", counters={"published.tof/depth/image": number})
        sent.append(manager.after(10))
    assert sent == [["READY=1", "WATCHDOG=1"], ["WATCHDOG=1"], [], ["WATCHDOG=1"], ["WATCHDOG=1"]]


def test_systemd_hears_in_words_what_happens(start):
    manager = start("sheet")
    manager.says("track/sheet", labels={"phase": "preparing", "kernels": "3 of 31"})
    manager.after(0)
    manager.notifier.update(RigView(RigPlaces("demo"), manager.live, (), 0.0, 2 * S, ""))
    assert manager.received() == []  # said already
    manager.estimates("sheet", "DEGRADED")
    manager.says("capture")
    manager.says("track/sheet", level=Health.LEVEL_WARNING, message="DEGRADED:\nfew vertices")
    manager.notifier.update(RigView(RigPlaces("demo"), manager.live, (), 0.0, 3 * S, ""))
    said = [message for message in manager.received() if message.startswith("STATUS=")]
    assert said == ["STATUS=sheet DEGRADED; track/sheet: DEGRADED: few vertices"]
    silent = RigView(RigPlaces("demo"), manager.live, (), 0.0, 9 * S, "", silent={"sheet": "no estimate for 6 s"})
    manager.notifier.update(silent)
    assert manager.received() == ["STATUS=sheet silent; track/sheet: DEGRADED: few vertices"]
    manager.notifier.stopping()
    assert manager.received() == ["STOPPING=1"]


@pytest.mark.parametrize(
    "environment",
    [
        {"WATCHDOG_USEC": "0"},
        {"WATCHDOG_USEC": "1e6 s"},
        {"WATCHDOG_USEC": "-1"},
        {"WATCHDOG_PID": str(os.getpid() + 1)},
    ],
)
def test_without_a_watchdog_none_is_fed(start, environment):
    manager = start("sheet", **environment)
    manager.estimates("sheet")
    assert manager.after(0) == ["READY=1"]


@pytest.mark.parametrize("address", ["", "/nowhere/notify", "@nowhere"])
def test_a_systemd_that_is_not_there_does_no_harm(address):
    before = os.listdir("/proc/self/fd")
    systemd.notifier({"NOTIFY_SOCKET": address}).stopping()
    assert os.listdir("/proc/self/fd") == before  # no socket is left


def test_a_systemd_that_does_not_read_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(systemd, "TIMEOUT_S", 0.001)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        notifier = systemd.notifier({"NOTIFY_SOCKET": str(tmp_path / "notify")})
        for _ in range(1000):
            notifier.stopping()
        manager.setblocking(False)
        assert len(list(_unread(manager))) < 1000  # it was full


def _unread(manager: socket.socket) -> Iterator[bytes]:
    with suppress(BlockingIOError):
        while True:
            yield manager.recv(1024)


@pytest.mark.slow
def test_a_running_rig_tells_systemd_when_it_is_ready_alive_and_ending(launch, endpoint, tmp_path, monkeypatch):
    """A rig that only records, in processes of its own."""
    (tmp_path / "rig.toml").write_text(
        f'version = 1\nname = "bench"\nbus.endpoint = "{endpoint}"\nrecord = {{ minimum_free_bytes = 0 }}\n'
        '[devices.sim]\nuri = "simulated://sheet?tof=32x24&sensors=tof"\n[sensors.tof]\ndevice = "sim"\n'
    )
    received = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(60)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "4000000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        process = launch("run", tmp_path / "rig.toml")
        while received.count("WATCHDOG=1") < 3:
            received.append(manager.recv(4096).decode())
        process.send_signal(signal.SIGTERM)
        while "STOPPING=1" not in received:
            received.append(manager.recv(4096).decode())
        assert process.wait(20) == 0
    order = [message for message in received if message in ("READY=1", "WATCHDOG=1", "STOPPING=1")]
    assert order == ["READY=1", *["WATCHDOG=1"] * (len(order) - 2), "STOPPING=1"]
