"""The experiment `live`: what it takes from the system, what it counts as lost, and a short run of the real service."""

import mmap
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.health_pb2 import Health

from abs_service.config import load
from drivers.encoding.mcap_file import McapFile
from evaluation.experiment import Context
from evaluation.service import live
from evaluation.service.live import losses, measurement, proc, recording, subscriber
from evaluation.service.live.measurement import StartTimes
from evaluation.service.live.rig import write_rig
from evaluation.service.live.service import Service
from evaluation.service.live.trend import Trend, rolling_minimum, trend

MINUTES = np.arange(600.0) / 60


@pytest.mark.parametrize("slope", [0.0, 0.5, -2.0])
def test_the_slope_of_what_grows_steadily(slope):
    found = trend(MINUTES, 300 + slope * MINUTES + 0.1 * np.random.default_rng(1).standard_normal(600))
    assert found.slope == pytest.approx(slope, abs=0.02)
    assert 0 < found.half_width < 0.02


@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_what_a_saw_tooth_stands_on_grows_as_fast_as_it_does(slope):
    tooth = 20 * np.mod(MINUTES, 2.1)
    found = trend(MINUTES, rolling_minimum(300 + slope * MINUTES + tooth, 150))
    assert found.slope == pytest.approx(slope, abs=0.15)
    assert (found.slope - found.half_width > 0.1) == (slope > 0)


def test_one_step_is_no_steady_growth():
    found = trend(MINUTES, 300 + 2.0 * (MINUTES > 1.5))
    assert found.slope > 0.1
    assert found.slope - found.half_width < 0.1


@pytest.mark.parametrize(
    ("growth", "met"), [(Trend(0.0, 0.2), True), (Trend(0.0, 0.5), False), (Trend(0.5, 0.1), False)]
)
def test_memory_must_be_known_not_to_grow(growth, met):
    assert live.memory_goal("track", growth).met == met


def test_usage_of_this_process():
    before = proc.usage(os.getpid())
    flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS  # new pages: an array may get some that the process had before
    with mmap.mmap(-1, 40_000_000, flags) as block:
        begin_s = time.process_time()
        while time.process_time() - begin_s < 0.1:
            block[:] = b"1" * len(block)
        after = proc.usage(os.getpid())
    assert 0.08 <= after.cpu_s - before.cpu_s < 5
    assert after.resident_bytes - before.resident_bytes > 30e6
    assert 30e6 < after.private_bytes - before.private_bytes <= after.resident_bytes


def test_usage_of_the_machine():
    before, own = proc.machine(), proc.usage(os.getpid())
    begin_s = time.monotonic()
    while time.monotonic() - begin_s < 0.3:
        pass
    after, elapsed_s = proc.machine(), time.monotonic() - begin_s
    cpu_s = proc.usage(os.getpid()).cpu_s - own.cpu_s
    assert cpu_s - 0.05 <= after.busy_s - before.busy_s <= (elapsed_s + 0.05) * (os.cpu_count() or 1)
    assert 0 <= after.stolen_s - before.stolen_s <= (elapsed_s + 0.05) * (os.cpu_count() or 1)


def test_usage_of_nobody():
    with pytest.raises(OSError, match="No such"):
        proc.usage(2**22 + 1)


def test_children_by_their_command():
    words = ["-c", "from setproctitle import setproctitle; setproctitle('abs-service capture x.toml'); input()"]
    with subprocess.Popen([sys.executable, *words], stdin=subprocess.PIPE) as child:
        deadline_s = time.monotonic() + 10
        while not (found := proc.children(os.getpid())) and time.monotonic() < deadline_s:
            time.sleep(0.01)
        child.communicate(b"\n")
    assert found == {"capture": child.pid}


def test_the_rig_is_one_that_the_service_takes(tmp_path):
    rig = load(write_rig(tmp_path, seed=3))
    assert rig.devices["sim"].uri == "simulated://sheet?seed=3&color=640x480"
    assert rig.record.enabled
    assert rig.record.directory == tmp_path / "takes"


@pytest.mark.slow
def test_a_cold_start_has_a_cache_of_its_own(tmp_path):
    cache = f"{measurement.CACHE}={tmp_path / 'cache'}"
    with Service(write_rig(tmp_path, seed=3), {measurement.CACHE: str(tmp_path / "cache")}) as service:
        environment = Path(f"/proc/{service.processes()['run']}/environ")
        while not (variables := environment.read_bytes().decode().split("\0"))[0]:
            time.sleep(0.001)  # exec(2) has closed the pipe that Popen waits for, but not set it yet
        assert cache in variables
        assert f"PATH={os.environ['PATH']}" in variables


def start_goals(cold):
    """Goals on the start of what took these times [s] with an empty cache."""
    seen = [StartTimes(1.0, 1.5), StartTimes(1.2, 3.0), StartTimes(1.1, 1.8)]
    return live.start_goals([0.05, 0.2, 0.06], seen, [StartTimes(one - 1, one) for one in cold])


def test_starts_are_judged_by_their_medians():
    assert [(goal.value, goal.met) for goal in start_goals([21.0])] == [(1.8, True), (21.0, False), (0.06, True)]
    assert len(start_goals([])) == 2


def write_states(path: Path, seqs):
    with path.open("xb") as stream:
        file = McapFile(stream)
        for seq in seqs:
            file.write("/sheet/state", DeformationState.DESCRIPTOR.full_name, b"", 1_000 - seq, seq)
            file.write("/other/state", DeformationState.DESCRIPTOR.full_name, b"", 1_000 - seq, 2 * seq)
        file.finish()


def test_a_recording_in_several_files_is_one(tmp_path):
    write_states(tmp_path / "a.mcap", [3, 4, 6])
    write_states(tmp_path / "b.mcap", [7, 9])
    (tmp_path / "c.mcap.active").write_bytes(b"unfinished")
    found = recording.sequence_numbers(tmp_path, ["sheet/state", "never/said"])
    assert found == {"sheet/state": {3, 4, 6, 7, 9}, "never/said": frozenset()}
    assert recording.count_missing(found["sheet/state"], 3, 9) == 2  # 5 and 8
    assert recording.count_missing(found["sheet/state"], 1, 4) == 2  # 1 and 2


def test_what_is_counted_up_to_a_moment():
    said = [Health(counters={"dropped.x": number}) for number in (1, 4, 9)]
    for t_ns, one in zip((10, 20, 30), said):
        one.header.t_host_ns = t_ns
    assert subscriber.counted(said, 15) == {"dropped.x": 4}
    assert subscriber.counted(said, 99) == {"dropped.x": 9}
    assert subscriber.counted([], 5) == {}


def test_which_counters_tell_of_losses():
    counts = {
        "capture": {"dropped.tof/depth/image": 2, "published.tof/depth/image": 90, "device.sim.late": 3},
        "track/sheet": {"skipped": 1, "estimates": 88, "unused.tof/depth.stale": 4, "malformed.tof/depth/image": 0},
        "record": {"missing.sheet/state": 5, "recorded": 400, "files": 1},
        "run": {"restarts.capture": 0},
    }
    counts["capture"] |= {"device.sim.frames": 270, "device.sim.unwanted": 7, "device.sim.reconnects": 1}
    assert losses.loss_counters(counts) == {
        "capture: dropped.tof/depth/image": 2,
        "capture: device.sim.late": 3,
        "capture: device.sim.reconnects": 1,
        "track/sheet: skipped": 1,
        "track/sheet: unused.tof/depth.stale": 4,
        "record: missing.sheet/state": 5,
    }


@pytest.mark.slow
def test_a_short_run_loses_nothing_unseen_and_says_what_each_process_used():
    found = live.run(live.QUICK, Context(1))
    values = found.values
    assert values["exit_code"] == 0
    # A machine that does much else may let the sheet get away for a moment, and leaves time for a few frames a second.
    assert values["share_tracking"] > 0.5
    assert values["estimates"] > 3 * live.QUICK.duration_s
    # Nothing is missing from the recording but the exposures that the simulated device was too late for.
    unrecorded = values["unrecorded"]
    assert unrecorded.pop("sheet/state") == 0
    assert set(unrecorded) == {"tof/depth/image", "tof/amplitude/image", "color/color/image"}
    assert set(unrecorded.values()) <= set(range(values["losses_from_start"].get("capture: device.sim.late", 0) + 1))
    processes = {row[0]: row[1:] for section in found.sections for row in rows(section, "Processes")}
    share, held, *_ = processes.pop("fork-server")
    assert share < 1
    assert 50 < held < 2000
    assert processes.keys() == {"run", "capture", "track", "record"}
    assert all(0 < share < 200 and 50 < held < 2000 for share, held, *_ in processes.values())
    machine = {row[0]: row[1:] for section in found.sections for row in rows(section, "All processors of the machine")}
    assert machine["the service"][0] == pytest.approx(sum(share for share, *_ in processes.values()), rel=0.1)
    assert all(most >= average for average, most in machine.values())
    ages = {row[0]: row[1:] for row in rows(found.sections[0], "Age of the estimates")}
    assert np.all(np.diff(ages["publication"]) >= 0)
    assert ages["arrival at the subscriber"][0] > ages["publication"][0]


def rows(section, caption):
    """Rows of the tables of a section that are called so."""
    return [
        row
        for block in section.blocks
        if getattr(block, "caption", "") == caption
        for row in getattr(block, "rows", ())
    ]
