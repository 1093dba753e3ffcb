"""A rig that runs, ends and leaves a recording: what other programs receive, how fast it starts and how it ends."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from abs_service import config
from evaluation.service.live.proc import children, is_running
from tests.system.running import TRACKING, abs_service, wait_until

pytestmark = pytest.mark.slow

TOPICS = {
    *(f"/tof/{stream}/{part}" for stream in ("depth", "amplitude") for part in ("image", "info")),
    *("/color/color/image", "/color/color/info", "/sim/truth", "/tf", "/config"),
    *(f"/{sensor}/{part}" for sensor in ("tof", "color") for part in ("calibration", "model")),
    *(f"/sheet/{part}" for part in ("state", "mesh", "theta", "topology")),
    *(f"/health/{component}" for component in ("run", "capture", "track/sheet", "record")),
}
FOXGLOVE = {
    "/tof/depth/image": "foxglove.RawImage",
    "/color/color/image": "foxglove.RawImage",
    "/tof/calibration": "foxglove.CameraCalibration",
    "/tf": "foxglove.FrameTransforms",
}


def end(process, send):
    """Asks a rig to end; returns how long it took [s]. Nothing is left over, and nothing is complained about."""
    alive = dict(children(process.pid))
    assert alive.keys() == {"fork-server", "capture", "track", "record"}
    begin_s = time.monotonic()
    send()
    assert process.wait(10) == 0
    took_s = time.monotonic() - begin_s
    fork_server = alive.pop("fork-server")
    assert not any(map(is_running, alive.values()))
    wait_until(lambda: not is_running(fork_server), 1, "the end of the fork server")
    complaints = process.stderr.read()
    assert "Traceback" not in complaints
    assert "FATAL" not in complaints
    return took_s


def read_whole(path):
    """Every channel's schema, the decoded messages of each topic, and the attachments of a finished recording."""
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None, "no index"
        assert summary.chunk_indexes
        schemas = {
            channel.topic: summary.schemas[channel.schema_id].name if channel.schema_id else ""
            for channel in summary.channels.values()
        }
        messages: dict[str, list] = {}
        for _, channel, message, decoded in reader.iter_decoded_messages():
            messages.setdefault(channel.topic, []).append((message, decoded))
        return schemas, messages, {attachment.name: attachment.data for attachment in reader.iter_attachments()}


@pytest.mark.realtime
def test_a_subscriber_receives_nearly_all_estimates_and_ctrl_c_leaves_a_complete_recording(run, tmp_path):
    process, listener = run
    begin_ns = time.monotonic_ns()
    wait_until(lambda: time.monotonic_ns() - begin_ns > 10_000_000_000, 20, "ten seconds")
    received = [(t_ns, state) for t_ns, state in listener.states() if state.header.t_host_ns > begin_ns]
    numbers = [state.header.seq for _, state in received]
    share = len(set(numbers)) / (numbers[-1] - numbers[0] + 1)
    ages_ms = [(t_ns - state.header.t_host_ns) * 1e-6 for t_ns, state in received]
    p50, p99 = np.percentile(ages_ms, [50, 99])
    print(f"{len(received)} states in 10 s, {share:.1%} of those published; age p50 {p50:.0f} ms, p99 {p99:.0f} ms")
    assert share >= 0.95
    assert all(state.status == TRACKING for _, state in received)

    # As a terminal does it: to the foreground process group.
    took_s = end(process, lambda: os.killpg(process.pid, signal.SIGINT))
    print(f"Ctrl-C took {took_s:.1f} s")
    assert took_s < 5
    (path,) = (tmp_path / "takes").iterdir()
    schemas, messages, attachments = read_whole(path)
    assert schemas.keys() == messages.keys() == TOPICS
    assert all(schemas.values())
    assert {topic: schemas[topic] for topic in FOXGLOVE} == FOXGLOVE
    image, info = messages["/tof/depth/image"][-1][1], messages["/tof/depth/info"][-1][1]
    assert (image.width, image.height, len(image.data)) == (176, 144, 2 * 176 * 144)
    assert len(messages["/tof/depth/image"]) == len(messages["/tof/depth/info"])
    assert info.header.rig == "demo"
    recorded = [message.sequence for message, _ in messages["/sheet/state"]]
    assert recorded == list(range(recorded[0], recorded[-1] + 1)), "an estimate is not recorded"
    assert set(numbers) <= set(recorded)
    rig_toml = attachments["rig.toml"].decode()
    assert config.loads(rig_toml, "attachment", tmp_path) == config.load(tmp_path / "rig.toml")


@pytest.mark.realtime
def test_sigterm_to_run_ends_everything_in_time_and_the_last_line_of_output_is_whole(run, tmp_path):
    process, listener = run
    wait_until(lambda: any(h.gauges["file_bytes"] > 1e6 for h in listener.health("record")), 20, "a growing file")
    took_s = end(process, lambda: process.send_signal(signal.SIGTERM))
    print(f"SIGTERM took {took_s:.1f} s")
    assert took_s < 5
    assert [path.suffix for path in (tmp_path / "takes").iterdir()] == [".mcap"]
    estimates = [json.loads(line) for line in (tmp_path / "output.jsonl").read_text().splitlines()]
    errors_mm = [estimate["error_mm"] for estimate in estimates if estimate["error_mm"] is not None]
    assert np.mean(errors_mm) < 5


@pytest.mark.realtime
def test_all_processes_log_where_run_was_told_to(rig_file, tmp_path):
    log = tmp_path / "rig.log"
    options = ("--no-record", "--duration", "3", "--log-level", "info", "--log-format", "json", "--log-file", log)
    assert abs_service("run", rig_file, *options).returncode in (0, 1)  # 1 before the first estimate
    records = [json.loads(line) for line in log.read_text().splitlines()]
    assert {one["process"] for one in records} == {"run", "capture", "track/sheet"}
    assert any(one["fields"].get("device") == "sim" for one in records if one["process"] == "capture")


@pytest.mark.realtime
def test_the_installed_command_complains_of_nothing(rig_file):
    """Warnings of the interpreter, such as of a module that runs twice, come of the console script alone."""
    command = [Path(sys.executable).with_name("abs-service"), "run", rig_file, "--no-record", "--duration", "5"]
    done = subprocess.run(command, capture_output=True, timeout=120, check=False)
    assert b"0 dropped" in done.stdout
    assert done.stderr == b""


def test_a_run_that_ends_by_itself_before_it_has_tracked_anything_fails(rig_file):
    rig_file.write_text(rig_file.read_text().replace("minimum_pixels = 200", "minimum_pixels = 1000000"))
    done = abs_service("run", rig_file, "--no-record", "--duration", "1")
    assert done.returncode == 1
    assert "sheet: nothing was tracked" in done.stdout


def test_a_misspelt_reference_ends_run_at_once(rig_file):
    rig_file.write_text(rig_file.read_text().replace('"tof/depth"', '"tof/dept"'))
    done = abs_service("run", rig_file, "--no-record", timeout_s=60)
    assert done.returncode == 2
    assert f'{rig_file}: synchronisation.reference = "tof/dept": ' in done.stderr


def test_standard_error_of_run_is_json(rig_file):
    rig_file.write_text(rig_file.read_text().replace("simulated://sheet?seed=1", "simulated://sheet?sed=1"))
    done = abs_service("run", rig_file, "--log-level", "info", "--log-format", "json", timeout_s=60)
    records = [json.loads(line) for line in done.stderr.splitlines()]
    assert done.returncode == 2
    assert {"run", "capture"} <= {one["process"] for one in records}
    assert records[-1]["message"].startswith(f"{rig_file}: devices.sim.uri = ")
    assert [one["fields"].get("exit_code") for one in records].count(2) == 1
