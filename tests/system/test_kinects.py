"""A whole rig of two emulated Kinects, on unmodified libusb, and a simulated time-of-flight camera."""

import json
import sys
from collections import Counter

import numpy as np
import pytest

from tests.drivers.kinect1 import testbed
from tests.system.kinects import ESTIMATES

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(testbed.why_not()), reason=testbed.why_not() or "never"),
]


def test_two_kinects_and_a_time_of_flight_camera_track_the_sheet_that_all_of_them_see(tmp_path, endpoint) -> None:
    program = [sys.executable, "-m", "tests.system.kinects", str(tmp_path), endpoint]
    done = testbed.run(program, cameras=2, timeout_s=280)
    print(done.stderr)
    assert done.returncode == 0, done.stderr
    estimates = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert len(estimates) >= ESTIMATES - 5
    missing = Counter(reason for estimate in estimates for reason in estimate["reasons"])
    silent = {reason: count for reason, count in missing.items() if reason.startswith("no frame from")}
    errors_mm = np.array([estimate["error_mm"] for estimate in estimates], float)
    print(f"{len(estimates)} estimates, error {np.nanmean(errors_mm):.1f} mm; {missing}")
    # Whatever arrives, the estimate is near the sheet; how much of it arrives in time is up to the machine.
    assert np.nanmedian(errors_mm) < 20
    if max(silent.values(), default=0) > 2 * len(estimates) / 3:
        pytest.skip(f"too busy a machine for three cameras in real time: {silent} of {len(estimates)}")
    assert {estimate["status"] for estimate in estimates} <= {"TRACKING", "DEGRADED"}
    assert missing.total() - sum(silent.values()) < 0.1 * len(estimates)
    assert np.nanmean(errors_mm) < 10
