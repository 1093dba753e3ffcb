"""`abs-service reload` and the configuration in memory that it exchanges."""

import tempfile

import pytest

from abs_service import config
from abs_service.bus.health import Health
from abs_service.bus.stamps import HeaderFactory, WallClock
from abs_service.commands.parts.rig_in_memory import in_memory
from abs_service.commands.running import reload
from abs_service.wire import commands
from abs_service.wire.commands import RefusedError
from tests.abs_service.bus.loopback import LoopbackBus


@pytest.fixture
def rig(tmp_path):
    """The demo rig, which records to a folder of the test."""
    demo = config.load_default()
    return demo.model_copy(update={"record": demo.record.model_copy(update={"directory": tmp_path / "takes"})})


def test_the_file_of_the_children_says_the_same_and_leaves_nothing_behind(rig, tmp_path, monkeypatch):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    with in_memory(rig, "rig.toml") as file:
        assert config.load(file.path) == rig
        assert not list(folder.iterdir()), "which would stay after a kill"
    assert not file.path.exists()


@pytest.mark.parametrize("source", ["/a b/rig.toml", "/" + "ä" * 3000])
def test_a_child_names_the_file_that_its_configuration_comes_from(rig, source):
    with in_memory(rig, source) as file:
        name = config.named(file.path)
        assert len(name) > 10
        assert source.endswith(name)
        file.path.write_text("x")
        with pytest.raises(config.ConfigError, match=f"^{name}: "):
            config.load(file.path)


def test_another_configuration_takes_its_place_and_a_shorter_one_leaves_no_rest(rig, tmp_path):
    longer = rig.model_copy(update={"record": rig.record.model_copy(update={"directory": tmp_path / ("x" * 200)})})
    with in_memory(rig, "rig.toml") as file:
        assert file.exchange(lambda: longer).components == ("record",)
        assert config.load(file.path) == longer
        assert file.exchange(lambda: rig).components == ("record",)
        assert config.load(file.path) == rig
        assert file.exchange(lambda: rig).components == ()


def test_a_file_name_that_is_not_utf_8_is_named(rig, tmp_path):
    record = rig.record.model_copy(update={"directory": tmp_path / "o\udcff"})
    with (
        pytest.raises(config.ConfigError, match=r"directory = .*: this name is not UTF-8"),
        in_memory(rig, "rig.toml") as file,
    ):
        file.write(rig.model_copy(update={"record": record}))


def test_what_cannot_be_used_is_refused_and_changes_nothing(rig):

    def wrong():
        raise config.ConfigError("rig.toml: trackers.sheet.budget_ms = -1 is wrong")

    with in_memory(rig, "rig.toml") as file:
        with pytest.raises(RefusedError, match="budget_ms = -1 is wrong"):
            file.exchange(wrong)
        with pytest.raises(RefusedError, match="name: can change only when the rig is stopped"):
            file.exchange(lambda: rig.model_copy(update={"name": "other"}))
        assert config.load(file.path) == rig


def test_a_rig_that_ends_takes_nothing_over(rig):
    with in_memory(rig, "rig.toml") as file:
        pass
    with pytest.raises(RefusedError, match="the rig ends"):
        file.exchange(lambda: rig)


def test_a_mistake_of_ours_is_not_taken_for_one_of_the_file(rig):
    def wrong():
        raise ZeroDivisionError

    with in_memory(rig, "rig.toml") as file, pytest.raises(ZeroDivisionError):
        file.exchange(wrong)


@pytest.mark.parametrize(
    ("changed", "refusal", "code", "words"),
    [
        ((("track/sheet", "record"), ()), "", 0, "starts again: track/sheet, record"),
        ((("record",), ("track/sheet",)), "", 0, "starts again: record; ends: track/sheet"),
        (((), ()), "", 0, "nothing has changed"),
        (((), ()), "name: can change only", 1, "the rig refuses: name: can change only"),
    ],
)
def test_the_answer_is_told(capsys, changed, refusal, code, words):
    bus, headers = LoopbackBus(), HeaderFactory("demo", WallClock())

    def act():
        if refusal:
            raise RefusedError(refusal)
        return changed

    commands.answer_reload(bus, headers, Health(bus, "run", headers), act)
    assert reload.request(bus, headers) == code
    assert capsys.readouterr().out == f"{words}\n"


def test_a_rig_that_gives_no_answer_is_said(capsys):
    assert reload.request(LoopbackBus(), HeaderFactory("demo", WallClock())) == 1
    assert 'no `abs-service run` of a rig "demo" answers there. If `name`' in capsys.readouterr().out
