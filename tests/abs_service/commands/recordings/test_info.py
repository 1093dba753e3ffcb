"""`abs-service info` shows of a recording what was written into it."""

import fcntl
import json
import subprocess
import sys

import numpy as np
import pytest
from absmsg.v1.deformed_mesh_pb2 import MeshTopology
from absmsg.v1.health_pb2 import Health

from abs_service import config
from abs_service.cli import main
from drivers.encoding.mcap_file import Compression, McapFile
from tests.abs_service.commands.recordings.estimated_recording import NAMES, SIMULATION, TOML, write_estimated
from tests.abs_service.commands.recordings.simulated_recording import write_take


def info(capsys, *paths):
    code = main(["info", *map(str, paths), "--json"])
    return code, [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_it_counts_images_estimates_and_statuses(tmp_path, capsys):
    code, (found,) = info(capsys, write_estimated(tmp_path / "x.mcap"))
    assert (code, found["finished"], found["damaged"]) == (0, True, 0)
    assert found["attachments"] == ["rig.toml"]
    assert found["sensors"] == {"color": [32, 24], "tof": [32, 24]}
    assert found["topics"]["/tof/depth/image"]["messages"] == 6
    assert found["topics"]["/tof/depth/image"]["rate_hz"] == pytest.approx(30.0, rel=1e-3)
    sheet = found["trackers"]["sheet"]
    assert (sheet["estimates"], sheet["meshes"]) == (6, 2)
    assert sheet["shares"] == pytest.approx(
        {"TRACKING": 1 / 2, "INITIALIZING": 1 / 6, "DEGRADED": 1 / 6, "LOST": 1 / 6}
    )
    assert sheet["longest_untracked_s"] == pytest.approx(2 / 30, rel=1e-3)  # between the third estimate and the fifth
    assert sheet["deviation_m"]["median"] == pytest.approx(0.003)


def test_the_configuration_is_told_in_short_as_values_and_as_it_is(tmp_path, capsys):
    toml = config.to_toml(config.load_default())
    path = write_take(tmp_path / "x.mcap", SIMULATION, [0], NAMES, toml)
    assert main(["info", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "device sim: simulated://sheet?seed=1" in lines
    assert any(line.startswith("tracker sheet of tof, color: model nurbs, region nearest") for line in lines)
    _, (found,) = info(capsys, path)
    assert found["configuration"]["trackers"]["sheet"]["region"]["type"] == "nearest"
    assert main(["info", str(path), "--config"]) == 0
    assert capsys.readouterr().out == toml


@pytest.mark.parametrize("toml", ["", "= no TOML", "devices = 1\n[trackers]\nsheet = 2\n"])
def test_a_configuration_that_says_nothing_is_left_out(tmp_path, capsys, toml):
    path = write_take(tmp_path / "x.mcap", SIMULATION, [0], NAMES, toml)
    assert main(["info", str(path)]) == 0
    assert not any(line.startswith(("device ", "tracker ")) for line in capsys.readouterr().out.splitlines()[1:4])
    assert main(["info", str(path), "--config"]) == (0 if toml else 2)
    assert ("no configuration is in this recording" in capsys.readouterr().err) == (not toml)


def test_exposures_that_are_missing_are_lost_and_leave_a_gap(tmp_path, capsys):
    path = write_take(tmp_path / "x.mcap", SIMULATION, [0, 1, 2, 3, 8, 9], NAMES, TOML)
    _, (found,) = info(capsys, path)
    topic = found["topics"]["/tof/depth/info"]
    assert (topic["lost"], topic["gaps"], topic["reconnects"]) == (4, 1, 0)
    assert topic["longest_gap_s"] == pytest.approx(5 / 30, rel=1e-3)


def test_why_a_device_delivered_fewer_exposures_stands_among_the_losses(tmp_path, capsys):
    counters = {"device.sim.frames": 90, "device.sim.late": 40, "device.sim.lost": 0, "published.tof/depth/image": 90}
    health = Health(component="capture", counters=counters)
    with (tmp_path / "x.mcap").open("wb") as stream:
        file = McapFile(stream, Compression.LZ4)
        file.write("/health/capture", Health.DESCRIPTOR.full_name, health.SerializeToString(), 1, 1)
        file.finish()
    assert main(["info", str(tmp_path / "x.mcap")]) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if " = " in line] == ["capture: device.sim.late = 40"]


def test_a_recording_that_was_cut_short_is_described_up_to_there(tmp_path, capsys):
    _, (found,) = info(capsys, write_estimated(tmp_path / "x.mcap", finish=False))
    assert not found["finished"]
    assert main(["info", str(tmp_path / "x.mcap")]) == 0
    assert "not finished (`abs-service recover`" in capsys.readouterr().out
    with (tmp_path / "x.mcap").open("rb") as recorder:
        fcntl.flock(recorder, fcntl.LOCK_EX)
        assert main(["info", str(tmp_path / "x.mcap")]) == 0
    assert ", still recorded\n" in capsys.readouterr().out


def test_people_get_one_line_per_topic(tmp_path, capsys):
    assert main(["info", str(write_estimated(tmp_path / "x.mcap"))]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "sensors: color 32 × 24 px, tof 32 × 24 px" in lines
    (depth,) = (line for line in lines if line.startswith("/tof/depth/image"))
    assert "30.0 Hz" in depth
    assert not any("/info" in line for line in lines)


def test_trackers_have_a_column_each_which_fits_into_a_narrow_window(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["info", str(write_estimated(tmp_path / "x.mcap"))]) == 0
    table = capsys.readouterr().out.partition("\ntracker ")[2].splitlines()
    assert table[1].split()[:3] == ["status", "50.0%", "TRACKING,"]
    assert [line.split()[-2:] for line in table if line.startswith("longest")] == [["0.1", "s"]]
    assert max(map(len, table)) <= 80


#: Page faults of a second `info` on a file.
_FAULTS = """
import resource, sys
from abs_service.cli import main
from drivers.encoding.mcap_file import Compression, McapFile
counts = []
for _ in range(2):
    main(["info", sys.argv[1], "--json"])
    counts.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
print(counts[1] - counts[0])
"""


def test_a_chunk_is_read_into_the_memory_of_the_one_before(tmp_path):
    images, noise = 200, np.random.default_rng(0)
    with (tmp_path / "x.mcap").open("wb") as stream:
        file = McapFile(stream, Compression.LZ4)  # as the recorder
        for number in range(images):
            file.write("/sheet/topology", MeshTopology.DESCRIPTOR.full_name, noise.bytes(230_400), number, number)
        file.finish()
    program = [sys.executable, "-c", _FAULTS, str(tmp_path / "x.mcap")]
    done = subprocess.run(program, check=True, capture_output=True, text=True)
    assert int(done.stdout.splitlines()[-1]) < 20 * images


def test_what_cannot_be_read_is_named_and_the_others_are_described(tmp_path, capsys):
    (tmp_path / "text.mcap").write_text("no recording")
    good = write_estimated(tmp_path / "x.mcap")
    assert main(["info", str(tmp_path / "nothing.mcap"), str(tmp_path / "text.mcap"), str(good), "--json"]) == 2
    output = capsys.readouterr()
    assert "nothing.mcap: No such file" in output.err
    assert "text.mcap: this is no MCAP file" in output.err
    assert json.loads(output.out)["file"] == str(good)
