"""`abs-service status` on real sessions: words, exit codes, and what does not answer."""

import json
import threading
import time

import pytest
from absmsg.v1.health_pb2 import Health as Message

from abs_service import cli
from abs_service.bus.contract import EVENTS
from abs_service.bus.health import Health, Level
from abs_service.bus.session import SessionMode, open_session
from abs_service.bus.stamps import HeaderFactory, WallClock


@pytest.fixture
def rig(open_bus):
    """A rig "demo" whose components publish their health every 50 ms, from a thread."""
    bus, ended = open_bus(), threading.Event()
    headers = HeaderFactory("demo", WallClock())
    components = {name: Health(bus, name, headers) for name in ("run", "capture", "track/sheet", "record")}
    for name in components:
        bus.declare_liveliness(name)

    def publish():
        while not ended.wait(0.05):
            for component in tuple(components.values()):
                component.publish()

    thread = threading.Thread(target=publish)
    thread.start()
    yield components
    ended.set()
    thread.join()


def status(endpoint, capsys, *options):
    code = cli.main(["status", "--connect", endpoint, *options])
    return code, capsys.readouterr()


def test_a_rig_that_works_is_described_part_by_part(rig, endpoint, capsys):
    rig["capture"].gauge("rate_hz.tof/depth/image", 29.96)
    rig["track/sheet"].label("phase", "tracking")
    rig["track/sheet"].gauge("solve_ms", 8.25)
    rig["track/sheet"].count("estimates", 12)
    rig["record"].label("file", "a.mcap.active")
    rig["record"].gauge("file_bytes", 2e6)
    rig["run"].count("restarts.record", 2)
    code, said = status(endpoint, capsys)
    assert code == 0
    assert said.out.splitlines() == [
        "demo  capture      ok       tof/depth 30.0 Hz",
        "demo  record       ok       a.mcap, 2.0 MB",
        "demo  run          ok       record restarted 2×",
        "demo  track/sheet  ok       tracking, 12 estimates, 8.2 ms each",
    ]


@pytest.mark.parametrize(("level", "code"), [(Level.WARNING, 0), (Level.ERROR, 1)])
def test_the_reason_is_told_and_errors_are_the_exit_code(rig, endpoint, capsys, level, code):
    rig["capture"].report("device sim", level, "sim: not there; plug it in")
    found, said = status(endpoint, capsys)
    assert found == code
    assert f"capture      {level.name.lower():<7}  sim: not there; plug it in\n" in said.out


def test_a_part_that_runs_and_says_nothing_is_an_error(rig, endpoint, capsys):
    del rig["track/sheet"]
    code, said = status(endpoint, capsys)
    assert code == 1
    assert "track/sheet  silent   runs, but sent no health for 1.5 s" in said.out


def test_a_process_that_was_given_up_has_a_line(rig, endpoint, capsys):
    run = rig["run"]
    run.report("track/hat", Level.ERROR, "track/hat failed: needed more than 5 restarts in 60 s")
    for name, text in {
        "sheet": "running",
        "hat": "failed: needed more than 5 restarts in 60 s",
        "mat": "",
        "cap": "backoff",
    }.items():
        run.label(f"process.track/{name}", text)
    code, said = status(endpoint, capsys)
    assert code == 1
    assert "track/hat    error    failed: needed more than 5 restarts in 60 s" in said.out
    assert "track/cap    warning  backoff" in said.out
    assert "track/mat" not in said.out, "which was removed"
    assert said.out.count("track/sheet") == 1


@pytest.mark.parametrize(
    ("condition", "code", "line"),
    [
        ("running: no health for 6 s", 1, "silent   running: no health for 6 s"),
        ("running", 0, "warning  starts"),
    ],
)
def test_a_process_that_is_not_on_the_bus_hangs_or_starts(rig, endpoint, capsys, condition, code, line):
    rig["run"].label("process.view", condition)
    found, said = status(endpoint, capsys)
    assert (found, f"view         {line}\n" in said.out) == (code, True)


def test_a_page_that_speaks_later_than_the_others_is_waited_for(rig, endpoint, open_bus, capsys):
    rig["run"].label("process.view", "running")
    page, ended = Health(open_bus(), "view", HeaderFactory("demo", WallClock())), threading.Event()

    def publish_later():
        ended.wait(0.7)
        while not ended.wait(0.05):
            page.publish()

    thread = threading.Thread(target=publish_later)
    thread.start()
    code, said = status(endpoint, capsys)
    ended.set()
    thread.join()
    assert (code, "view         ok" in said.out) == (0, True)


def test_keys_with_wildcards_or_without_a_component_are_nobodys(rig, endpoint, capsys):
    ended = threading.Event()
    keys = ("**", "abs/**", "abs/demo/health", "abs/*/health/run", "abs/demo/live/**", "abs/demo/*/state")

    def disturb():
        with open_session(endpoint, SessionMode.CLIENT) as stranger:
            tokens = [stranger.liveliness().declare_token(key) for key in ("abs/demo/live", *keys)]
            while not ended.wait(0.01):
                for key in (*keys, "abs/demo/health/another"):
                    stranger.put(key, Message().SerializeToString())
            for token in tokens:
                token.undeclare()

    thread = threading.Thread(target=disturb)
    thread.start()
    try:
        time.sleep(0.3)
        code, said = status(endpoint, capsys)
    finally:
        ended.set()
        thread.join()
    assert (code, said.out.count("\n")) == (0, 4)


def test_a_bus_that_capture_hosts_lacks_no_run(open_bus, endpoint, capsys):
    bus = open_bus()
    bus.declare_liveliness("capture")
    code, said = status(endpoint, capsys)
    assert (code, said.out) == (1, "demo  capture  silent   runs, but sent no health for 1.5 s\n")


def test_scripts_get_counters_too(rig, endpoint, capsys):
    rig["capture"].count("dropped.tof/depth/image", 3)
    rig["capture"].report("device sim", Level.WARNING, "slow")
    code, said = status(endpoint, capsys, "--json", "--rig", "demo")
    [answer] = map(json.loads, said.out.splitlines())
    parts = {part["component"]: part for part in answer["parts"]}
    assert (code, answer["rig"], sorted(parts)) == (0, "demo", ["capture", "record", "run", "track/sheet"])
    assert parts["capture"]["counters"] == {"dropped.tof/depth/image": 3}
    assert (parts["capture"]["level"], parts["capture"]["reason"]) == ("warning", "slow")


@pytest.mark.parametrize(
    "payload",
    [
        b"\xff\xff",
        Message(component="track/sheet", level=99).SerializeToString(),  # pyright: ignore[reportArgumentType]
        Message(component="track/sheet", level=Message.LEVEL_OK, message="\x1b[2J").SerializeToString(),
        Message(component="track/sheet", level=Message.LEVEL_OK, gauges={"solve_ms": float("nan")}).SerializeToString(),
    ],
)
def test_what_is_no_health_does_not_count(rig, endpoint, open_bus, capsys, payload):
    del rig["track/sheet"]
    stranger, ended = open_bus().publisher("health/track/sheet", "absmsg.v1.Health", EVENTS), threading.Event()
    thread = threading.Thread(target=lambda: [stranger.put(payload) for _ in iter(lambda: ended.wait(0.05), True)])
    thread.start()
    code, said = status(endpoint, capsys)
    ended.set()
    thread.join()
    assert code == 1
    assert "track/sheet  silent   runs, but sent no health for 1.5 s" in said.out


def test_nothing_answers(endpoint, capsys):
    code, said = status(endpoint, capsys)
    assert code == 3
    assert f'--connect = "{endpoint}": nothing answers there within 1 s' in said.err
    assert said.err.count("--") == 1, "an option that `status` does not have"


def test_another_rig_answers(rig, endpoint, capsys):
    code, said = status(endpoint, capsys, "--rig", "other")
    assert code == 3
    assert f'no rig "other" answers at {endpoint} within 1.5 s' in said.err


@pytest.mark.parametrize("options", [["--rig", "a/b"], ["--connect", "7447"]])
def test_wrong_arguments(options, capsys):
    assert cli.main(["status", *options]) == 2
    assert "abs-service: error: " in (said := capsys.readouterr().err)
    assert "bus.endpoint" not in said, "a key of a file that nobody gave"


def test_a_file_names_rig_and_endpoint(rig, endpoint, capsys, tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        f'version = 1\nname = "other"\nbus.endpoint = "{endpoint}"\nrecord = {{}}\n'
        '[devices.sim]\nuri = "simulated://sheet"\n[sensors.tof]\ndevice = "sim"\n'
    )
    assert cli.main(["status", str(path)]) == 3
    assert 'no rig "other"' in capsys.readouterr().err
