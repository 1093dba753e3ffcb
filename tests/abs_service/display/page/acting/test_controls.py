"""Controls of devices on the page, without a rig."""

from contextlib import redirect_stdout
from functools import partial
from io import StringIO

import pytest

viser = pytest.importorskip("viser")

from abs_service.bus.health import Health  # noqa: E402 - needs viser
from abs_service.bus.stamps import HeaderFactory, WallClock  # noqa: E402 - needs viser
from abs_service.capture.requested_controls import RequestedControls  # noqa: E402 - needs viser
from abs_service.display.page.acting.controls import DeviceControls  # noqa: E402 - needs viser
from abs_service.wire import control_commands  # noqa: E402 - needs viser
from tests.abs_service.bus.loopback import LoopbackBus  # noqa: E402 - needs viser
from tests.abs_service.capture.fake_device import adjustable, working  # noqa: E402 - needs viser


class Bench:
    """The tab of a page, and the controls of its rig's devices."""

    def __init__(self, server, monkeypatch):
        self.bus, self.headers, self.added = LoopbackBus(), HeaderFactory("demo", WallClock()), {}
        self.url, gui = f"http://127.0.0.1:{server.get_port()}", server.gui
        for name in ("add_text", "add_checkbox", "add_dropdown", "add_markdown", "add_button"):
            monkeypatch.setattr(gui, name, partial(self.spy, getattr(gui, name)))
        self.gui, self.tab, self.monkeypatch = gui, gui.add_tab_group().add_tab("Devices"), monkeypatch

    def spy(self, add, label, *arguments, **options):
        handle = self.added[label.partition(" [")[0]] = add(label, *arguments, **options)
        return handle

    def capture(self, name, device):
        act = partial(RequestedControls().set, device=device)
        health = Health(LoopbackBus(), "capture", self.headers)
        control_commands.answer_controls(self.bus, name, self.headers, health, act)
        return device.controls

    def page(self, *devices):
        send = partial(control_commands.set_controls, self.bus, headers=self.headers, timeout_s=1.0)
        return DeviceControls(self.gui, self.tab, devices, lambda device, values: send(device, values=values))

    @property
    def said(self):
        texts = [one for one in self.added.values() if isinstance(one, viser.GuiMarkdownHandle)]
        return texts[0].content


@pytest.fixture
def bench(monkeypatch):
    """A page that nobody opens."""
    with redirect_stdout(StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
        yield Bench(server, monkeypatch)
        server.stop()


def test_controls_are_shown_as_they_are(bench):
    bench.capture("cam", adjustable())
    bench.page("cam").read()
    inputs = {name: bench.added[name] for name in ("exposure_s", "auto_exposure", "infrared_gain", "sync_role")}
    assert [one.value for one in inputs.values()] == ["0.01", True, "12", "free"]
    assert inputs["exposure_s"].hint == "0.001 to 0.033 s"
    assert inputs["sync_role"].options == ("free", "master")
    assert bench.said == ""


def test_only_what_was_changed_is_set_and_all_is_shown_as_it_is_then(bench):
    controls, page = bench.capture("cam", adjustable()), bench.page("cam")
    page.read()
    bench.added["exposure_s"].value = "0.02"
    page.set("cam")
    assert controls.get("exposure_s") == 0.02
    assert bench.added["auto_exposure"].value is False, "the device ended it"
    assert bench.said.endswith("```toml\n[devices.cam.controls]\nexposure_s = 0.02\n```")
    page.set("cam")
    assert bench.said == "Nothing was changed."


def test_switches_are_set_first_since_they_may_allow_the_rest(bench):
    controls, page = bench.capture("cam", adjustable()), bench.page("cam")
    page.read()
    bench.added["exposure_s"].value, bench.added["auto_exposure"].value = "0.02", False
    page.set("cam")
    assert "auto_exposure = false\nexposure_s = 0.02\n" in bench.said
    assert controls.get("exposure_s") == 0.02


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("exposure_s", "2", "cam refuses: exposure_s = 2.0: must be a number from 0.001 to 0.033 s."),
        ("exposure_s", "fast", 'exposure_s = "fast": must be a number.'),
        ("infrared_gain", "1.5", 'infrared_gain = "1.5": must be a whole number.'),
    ],
)
def test_a_wrong_value_is_told_and_stays_to_be_corrected(bench, name, given, words):
    bench.capture("cam", adjustable())
    page = bench.page("cam")
    page.read()
    bench.added[name].value = given
    page.set("cam")
    assert bench.said == words
    assert bench.added[name].value == given


def test_a_device_without_controls_and_one_that_is_not_captured_are_told(bench):
    bench.capture("plain", working())
    bench.page("plain", "gone").read()
    assert bench.said == "plain has no controls.\n\ngone gives no answer. Is it captured?"


def test_a_device_that_has_other_controls_now_gets_new_inputs(bench):
    bench.capture("cam", adjustable())
    page = bench.page("cam")
    page.read()
    before = bench.added["exposure_s"]
    page.read()
    assert bench.added["exposure_s"] is before
    bench.capture("cam", working())
    page.read()
    bench.capture("cam", adjustable())
    page.read()
    assert bench.added["exposure_s"] is not before


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.timeout(120)
def test_a_change_on_the_page_in_a_browser_reaches_the_device(bench, browser):
    controls, _ = bench.capture("cam", adjustable()), bench.page("cam")
    page = browser.new_page()
    page.goto(bench.url)
    page.get_by_role("button", name="Read the controls").click()
    page.locator("input:visible").first.fill("0.02")
    page.get_by_role("button", name="Set", exact=True).click()
    page.get_by_text("To keep this choice").wait_for()
    assert controls.get("exposure_s") == 0.02
