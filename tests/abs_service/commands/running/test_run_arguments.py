"""Changes of a configuration by the command line of `run`, and the processes that follow."""

import argparse
from pathlib import Path

import pytest

from abs_service import config
from abs_service.bus.keys import KeyNameError
from abs_service.bus.session import BusError
from abs_service.commands import run
from abs_service.config.tables.bus import BusTable, TlsTable


def arguments(*given):
    parser = argparse.ArgumentParser()
    run.add_arguments(parser)
    return parser.parse_args(given)


class TestWhatTheCommandLineChanges:
    def changed(self, *given):
        return run.effective(config.load_default(), arguments(*given))

    def test_nothing_by_default(self):
        assert self.changed() == config.load_default()

    def test_name_seed_folder_and_recording(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "here").symlink_to("here")  # a loop, which the check of the folder names
        rig = self.changed("--rig", "other", "--seed", "9", "--out", "here", "--no-record")
        assert (rig.name, rig.record.directory, rig.record.enabled) == ("other", tmp_path / "here", False)
        assert rig.devices["sim"].uri == "simulated://sheet?seed=9"

    def test_what_another_host_captures_comes_by_another_router(self):
        rig = self.changed("--connect", "tcp/far:7447")
        assert rig.bus.routers == ("tcp/far:7447",)
        assert rig.bus.endpoint == config.load_default().bus.endpoint

    def test_another_host_that_cannot_be_reached_so_is_refused(self):
        with pytest.raises(BusError, match='--connect = "far": not an endpoint; write PROTOCOL/HOST:PORT'):
            self.changed("--connect", "far")

    def test_a_link_to_another_host_is_encrypted_if_the_rig_is(self):
        rig = config.load_default()
        bus = BusTable(endpoint="tls/rig:7447", tls=TlsTable(authority=Path("a"), certificate=Path("c"), key=Path("k")))
        with pytest.raises(BusError, match=r'^--connect = "tcp/far:7447": must begin with tls/'):
            run.effective(rig.model_copy(update={"bus": bus}), arguments("--connect", "tcp/far:7447"))

    def test_a_seed_for_devices_of_another_host_is_refused(self, capsys):
        with pytest.raises(SystemExit):
            self.changed("--connect", "tcp/far:7447", "--seed", "1")
        assert "not allowed with argument" in capsys.readouterr().err

    def test_a_name_that_cannot_be_a_key_is_refused(self):
        with pytest.raises(KeyNameError):
            self.changed("--rig", "a/b")

    @pytest.mark.parametrize(
        ("uri", "seeded"),
        [
            ("simulated://sheet", "simulated://sheet?seed=5"),
            ("simulated://board?sensors=tof,color&seed=1", "simulated://board?sensors=tof,color&seed=5"),
            ("replay://a.mcap?loop=1", "replay://a.mcap?loop=1"),
        ],
    )
    def test_the_seed_reaches_simulated_devices_only(self, uri, seeded):
        assert run.with_seed(uri, 5) == seeded


def test_a_rig_has_one_process_per_tracker_and_stops_its_recorder_last(tmp_path):
    rig = config.load_default()
    children = run.children(rig, tmp_path / "x.toml")
    assert [child.component for child in sorted(children, key=lambda child: child.stage)] == [
        "capture",
        "track/sheet",
        "record",
    ]
    elsewhere = run.children(rig, tmp_path / "x.toml", captured_at="tcp/far:7447")
    assert [child.component for child in elsewhere] == ["track/sheet", "record"]
    off = rig.model_copy(update={"record": rig.record.model_copy(update={"enabled": False})})
    assert "record" not in [child.component for child in run.children(off, tmp_path / "x.toml")]
