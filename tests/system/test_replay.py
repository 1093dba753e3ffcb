"""A recording of `run`, tracked again: offline frame by frame, live at its own pace."""

import json
import signal
import time

import numpy as np
import pytest
from mcap.reader import make_reader

from tests.system.running import RigListener, abs_service, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


@pytest.fixture
def recording(run, tmp_path):
    """About four seconds of the demo rig, and what the live tracker found."""
    process, listener = run
    enough = len(listener.states()) + 60
    wait_until(lambda: len(listener.states()) > enough, 30, "two more seconds")
    process.send_signal(signal.SIGTERM)
    assert process.wait(10) == 0
    (path,) = (tmp_path / "takes").iterdir()
    return path, estimates_of((tmp_path / "output.jsonl").read_text())


def estimates_of(output):
    return [json.loads(line) for line in output.splitlines()]


def mean_error_mm(estimates):
    return float(np.mean([estimate["error_mm"] for estimate in estimates if estimate["error_mm"] is not None]))


def count(path, topic):
    with path.open("rb") as stream:
        return sum(1 for _ in make_reader(stream).iter_messages(topics=topic))


def test_offline_every_frame_is_tracked_and_live_gives_the_pace_and_an_end(recording, endpoint, launch):
    path, live = recording
    done = abs_service("replay", path, "--json")
    assert done.returncode == 0, done.stderr
    offline = estimates_of(done.stdout)
    assert len(offline) == count(path, "/tof/depth/image"), "a frame set was dropped"
    # A recording may begin amid an exposure, and lacks what a machine that does much else dropped while it was made.
    assert np.mean([estimate["status"] == "TRACKING" for estimate in offline]) > 0.9
    print(f"error offline {mean_error_mm(offline):.2f} mm, live {mean_error_mm(live):.2f} mm")
    assert mean_error_mm(offline) < 1.5 * mean_error_mm(live)

    process = launch("replay", path, "--speed", "1", "--json", stdout=-1)
    begin_s = time.monotonic()
    with RigListener(endpoint, "sheet/state") as listener:
        out, complaints = process.communicate(timeout=60)
        assert process.returncode == 0, complaints
        print(f"replay at speed 1 took {time.monotonic() - begin_s:.1f} s, start included")
        arrivals_ns, states = zip(*listener.states(), strict=True)
    estimates = estimates_of(out)
    # With those that were passed over: a machine that does much else may skip some, and counts them.
    sets = len(states) + sum(state.skipped for state in states[1:])
    rate_hz = (sets - 1) / np.ptp([state.header.t_host_ns for state in states]) * 1e9
    pace = np.ptp([state.header.t_host_ns for state in states]) / np.ptp(arrivals_ns)
    print(f"{len(estimates)} estimates, {rate_hz:.1f} sets/s at {pace:.2f} of the pace")
    print(f"error {mean_error_mm(estimates):.2f} mm")
    assert 24 < rate_hz < 31
    assert 0.8 < pace < 1.25
    assert len(states) > 30
    # Each mesh has the noise of its own first image: 0.36 to 0.55 mm on average, by the image that is the first.
    assert mean_error_mm(estimates) < 2 * mean_error_mm(live)
    assert "Traceback" not in complaints
