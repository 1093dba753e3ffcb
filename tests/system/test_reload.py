"""A rig reads its file again while it runs: one tracker starts anew, the other one keeps its object."""

import signal
import subprocess

import pytest
from absmsg.v1.sensor_model_pb2 import Config

from abs_service.bus import keys
from tests.system.running import START_S, TRACKING, RigListener, abs_service, wait_until
from tests.system.test_two_trackers import EXAMPLE, states

pytestmark = [pytest.mark.slow, pytest.mark.realtime, pytest.mark.timeout(600)]

#: Time that the trackers have for what is asked of them [s].
PATIENCE_S = 60.0


def tracks(listener, name, boot_id, count=10):
    """True once a tracker's process other than `boot_id` has said TRACKING so many times."""
    return (
        sum(state.status == TRACKING and state.header.boot_id != boot_id for state in states(listener, name)) >= count
    )


def test_one_tracker_starts_anew_and_the_other_one_keeps_its_object(endpoint, launch, tmp_path):
    rig_file = tmp_path / "pair.toml"
    example = EXAMPLE.read_text("utf-8").replace('"../../recordings"', '"takes"\nminimum_free_bytes = 0')
    # A machine that does much else needs longer to take the end of a recording to disk.
    text = f'{example}\n[bus]\nendpoint = "{endpoint}"\n\n[run]\nstop_timeout_s = 20.0\n'
    rig_file.write_text(text, encoding="utf-8")
    process = launch("run", rig_file, "--json", stdout=subprocess.DEVNULL)
    with RigListener(endpoint, rig="pair") as listener:
        wait_until(lambda: all(tracks(listener, name, "") for name in ("left", "right")), START_S, "TRACKING of both")
        left, right = (states(listener, name)[-1] for name in ("left", "right"))

        rig_file.write_text(text.replace("[trackers.left]", "[trackers.left]\nbudget_ms = -1.0"), encoding="utf-8")
        refused = abs_service("reload", rig_file)
        assert refused.returncode == 2
        assert "trackers.left.budget_ms" in refused.stderr
        rig_file.write_text(text.replace("stop_timeout_s = 20.0", "stop_timeout_s = 21.0"), encoding="utf-8")
        refused = abs_service("reload", rig_file)
        assert (refused.returncode, refused.stdout[:21]) == (1, "the rig refuses: run:")

        rig_file.write_text(text.replace("[trackers.left]", "[trackers.left]\nbudget_ms = 29.0"), encoding="utf-8")
        done = abs_service("reload", rig_file)
        assert (done.returncode, done.stdout) == (0, "starts again: track/left, record\n")
        wait_until(lambda: tracks(listener, "left", left.header.boot_id), PATIENCE_S, "TRACKING with the new budget")
        after = states(listener, "right")
        wait_until(lambda: len(states(listener, "right")) > len(after) + 30, PATIENCE_S, "estimates of the other one")
        configs = [one.sample.payload for one in listener.received if one.sample.topic == keys.CONFIG]
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 0, said
    assert {state.budget_ms for state in states(listener, "left")} == {left.budget_ms, 29.0}
    kept = [state for state in states(listener, "right") if state.header.seq > right.header.seq]
    assert {(state.mesh_version, state.header.boot_id) for state in kept} == {
        (right.mesh_version, right.header.boot_id)
    }
    assert "budget_ms = 29.0" in Config.FromString(configs[-1]).toml
    takes = sorted((tmp_path / "takes").glob("pair_*.mcap"))
    assert len(takes) == 2, "a recording has one configuration"
