"""Two trackers in one rig, each on a sheet of its own, get the same images, and neither waits for the other."""

import json
import signal
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from tests.system.running import START_S, TRACKING, RigListener, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.realtime]

EXAMPLE = Path(__file__).parents[2] / "examples" / "rigs" / "two_trackers.toml"
NAMES = ("left", "right")
#: How long both are watched [s]: some hundred estimates each.
WATCHED_S = 15.0


def states(listener, name):
    """Every estimate of one tracker so far."""
    return [state for _, state in listener.states(name)]


def both_track(listener):
    return all(Counter(state.status for state in states(listener, name))[TRACKING] > 10 for name in NAMES)


def test_both_track_their_own_sheet_and_neither_starves(endpoint, launch, tmp_path):
    rig_file = tmp_path / "pair.toml"
    rig_file.write_text(f'{EXAMPLE.read_text("utf-8")}\n[bus]\nendpoint = "{endpoint}"\n', encoding="utf-8")
    output = tmp_path / "output.jsonl"
    with output.open("w", encoding="utf-8") as stream:
        process = launch("run", rig_file, "--json", "--no-record", stdout=stream)
        with RigListener(endpoint, rig="pair") as listener:
            wait_until(lambda: both_track(listener), START_S, "TRACKING of both")
            begin = {name: len(states(listener, name)) for name in NAMES}
            time.sleep(WATCHED_S)
            watched = {name: states(listener, name)[begin[name] :] for name in NAMES}
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
    errors: dict[str, list[float]] = {name: [] for name in NAMES}
    for line in output.read_text("utf-8").splitlines():
        estimate = json.loads(line)
        errors[estimate["tracker"]].append(np.nan if estimate["error_mm"] is None else estimate["error_mm"])
    for name in NAMES:
        solve_ms = np.mean([state.solve_ms for state in watched[name]])
        print(
            f"{name}: {len(watched[name])} estimates, {solve_ms:.1f} ms each, error {np.nanmedian(errors[name]):.2f} mm"
        )
        # A machine that does much else may let a moving sheet get away for a moment.
        assert np.mean([state.status == TRACKING for state in watched[name]]) > 0.8
        assert np.nanmedian(errors[name]) < 2
    counts = [len(watched[name]) for name in NAMES]
    assert min(counts) > WATCHED_S  # more than one in a second, on whatever machine
    # Neither starves. Idle cores differ by 1 %; on a machine that shares its cores with others, 19 % were seen.
    assert max(counts) <= 1.5 * min(counts)
    centers = [
        np.median([np.reshape(state.theta, (-1, 3)).mean(axis=0)[0] for state in watched[name]]) for name in NAMES
    ]
    assert centers[0] < -0.08 < 0.08 < centers[1]
