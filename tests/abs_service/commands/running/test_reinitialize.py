"""`abs-service reinitialize` tells a tracker, and says what came of it."""

from contextlib import nullcontext

import pytest
from absmsg.v1 import deformation_state_pb2

from abs_service.bus import keys
from abs_service.bus.contract import STATE
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.cli import main
from abs_service.commands.running import reinitialize
from abs_service.wire import commands
from tests.abs_service.bus.loopback import LoopbackBus

SEED = commands.Choice(seed=(111, 133))
STATES = deformation_state_pb2.DeformationState.DESCRIPTOR.full_name


class Tracker:
    """Publishes a state of a mesh; finds another one when it is told to, if there is one."""

    def __init__(self, bus: LoopbackBus, finds: bool):
        self.headers = HeaderFactory("demo", WallClock())
        self._states = bus.publisher(keys.state("sheet"), STATES, STATE)
        self._finds = finds
        self._version = 1
        health = Health(bus, "track/sheet", self.headers)
        commands.answer_reinitialize(bus, "sheet", self.headers, health, self._on_command)

    def publish(self) -> None:
        self._states.put(deformation_state_pb2.DeformationState(mesh_version=self._version).SerializeToString())

    def _on_command(self, choice: commands.Choice) -> str:
        self._version += self._finds
        self.publish()
        return f"[trackers.sheet.region]\npixel = {list(choice.seed)}\n" if choice.seed else ""


def bus_of(monkeypatch, finds: bool) -> LoopbackBus:
    """A bus on which a tracker answers each new subscriber."""
    monkeypatch.setattr(reinitialize, "TIMEOUT_S", 0.2)
    bus = LoopbackBus()
    tracker = Tracker(bus, finds)
    subscribe = bus.subscribe

    def and_publish(pattern, on_sample):
        subscription = subscribe(pattern, on_sample)
        tracker.publish()
        return subscription

    monkeypatch.setattr(bus, "subscribe", and_publish)
    return bus


@pytest.mark.parametrize(
    ("finds", "code", "words"), [(True, 0, "has a new mesh, version 2"), (False, 1, "found no object within")]
)
def test_the_request_is_sent_and_the_new_mesh_reported(monkeypatch, capsys, finds, code, words):
    assert reinitialize.request(bus_of(monkeypatch, finds), "sheet", HeaderFactory("demo", WallClock())) == code
    said = capsys.readouterr().out
    assert words in said
    assert "rig file" not in said


def test_with_a_seed_the_lines_that_keep_it_are_printed(monkeypatch, capsys):
    assert reinitialize.request(bus_of(monkeypatch, True), "sheet", HeaderFactory("demo", WallClock()), SEED) == 0
    assert capsys.readouterr().out.endswith("region:\n\n[trackers.sheet.region]\npixel = [111, 133]\n")


@pytest.mark.parametrize("seed", [["-1", "2"], ["1", "16384"], ["1.5", "2"], ["1"]])
def test_a_seed_that_is_no_pixel_is_a_mistake_of_the_user(seed):
    with pytest.raises(SystemExit) as ended:
        main(["reinitialize", "--seed", *seed])
    assert ended.value.code == 2


def test_a_box_is_a_polygon_in_any_order():
    assert commands.box(80, 90, 160, 170) == ((80, 90), (160, 90), (160, 170), (80, 170))
    assert sorted(commands.box(160, 170, 80, 90)) == sorted(commands.box(80, 90, 160, 170))


@pytest.mark.parametrize(
    ("typed", "choice"),
    [
        ("", commands.AS_CONFIGURED),
        ("--seed 111 133", SEED),
        ("--box 80 90 160 170", commands.Choice(polygon=commands.box(80, 90, 160, 170))),
        ("--polygon 80 90 160 90 120 170", commands.Choice(polygon=((80, 90), (160, 90), (120, 170)))),
    ],
)
def test_what_is_typed_is_asked_for(monkeypatch, typed, choice):
    asked = []
    monkeypatch.setattr(reinitialize.rig_process, "open_bus", lambda *_: nullcontext(LoopbackBus()))
    monkeypatch.setattr(reinitialize, "request", lambda bus, name, headers, choice: asked.append((name, choice)) or 0)
    assert main(["reinitialize", *typed.split()]) == 0
    assert asked == [("sheet", choice)]


@pytest.mark.parametrize(
    "typed", ["--polygon 1 2 3 4", "--polygon 1 2 3 4 5 6 7", "--box 1 2 3", "--seed 1 2 --box 1 2 3 4"]
)
def test_what_is_no_choice_is_a_mistake_of_the_user(typed):
    with pytest.raises(SystemExit) as ended:
        main(["reinitialize", *typed.split()])
    assert ended.value.code == 2


def test_a_silent_tracker_is_named(monkeypatch, capsys):
    monkeypatch.setattr(reinitialize, "TIMEOUT_S", 0.05)
    assert reinitialize.request(LoopbackBus(), "sheet", HeaderFactory("demo", WallClock())) == 1
    assert 'tracker "sheet" publishes nothing' in capsys.readouterr().out


def test_a_tracker_that_takes_no_command_is_named(monkeypatch, capsys):
    monkeypatch.setattr(reinitialize, "TIMEOUT_S", 0.2)
    bus = LoopbackBus()
    subscribe = bus.subscribe

    def and_publish(pattern, on_sample):
        subscription = subscribe(pattern, on_sample)
        bus.publisher(keys.state("sheet"), STATES, STATE).put(
            deformation_state_pb2.DeformationState().SerializeToString()
        )
        return subscription

    monkeypatch.setattr(bus, "subscribe", and_publish)
    assert reinitialize.request(bus, "sheet", HeaderFactory("demo", WallClock())) == 1
    assert 'tracker "sheet" refuses: it gives no answer' in capsys.readouterr().out
