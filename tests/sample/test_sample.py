"""The sample recording: small, readable by everybody, and tracked as when it was made."""

import json

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from tests.sample.sample import EXPOSURES, GOLDEN, SAMPLE
from tests.system.running import abs_service

#: Rounding differs between machines and turns the search elsewhere; another seed of it moves Θ by 2 mm [mm].
TOLERANCE_MM = 5.0


def test_it_is_small_and_complete_and_tells_nothing_about_who_made_it():
    assert SAMPLE.stat().st_size <= 1_000_000
    with SAMPLE.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert reader.get_summary() is not None
        topics = [channel.topic for _, channel, _, _ in reader.iter_decoded_messages()]
        (attachment,) = reader.iter_attachments()
    assert topics.count("/tof/depth/image") == topics.count("/color/color/info") == len(EXPOSURES)
    assert topics.count("/sim/truth") == len(EXPOSURES)
    assert {"/tf", "/config", "/tof/model", "/color/calibration"} <= set(topics)
    assert b'directory = "recordings"' in attachment.data


@pytest.mark.slow
def test_a_process_that_compiles_the_kernels_finds_the_same_theta_as_one_that_loads_them(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    said = [abs_service("replay", SAMPLE, "--json", "--out", tmp_path / name) for name in ("cold.mcap", "warm.mcap")]
    cold, warm = ([json.loads(line)["theta"] for line in done.stdout.splitlines()] for done in said)
    assert len(cold) == len(EXPOSURES)
    assert cold == warm


@pytest.mark.slow
def test_replay_finds_the_same_deformation_as_when_it_was_made(tmp_path):
    done = abs_service("replay", SAMPLE, "--json", "--out", tmp_path / "again.mcap")
    assert done.returncode == 0, done.stderr
    estimates = [json.loads(line) for line in done.stdout.splitlines()]
    assert [estimate["status"] for estimate in estimates] == ["TRACKING"] * len(EXPOSURES)
    theta = np.array([estimate["theta"] for estimate in estimates])
    golden = np.array(json.loads(GOLDEN.read_text(encoding="utf-8"))["theta"])
    away_mm = np.sqrt(np.mean((theta - golden) ** 2)) * 1e3
    print(f"Θ is {away_mm:.3g} mm (root mean square) away from when the sample was made")
    assert away_mm < TOLERANCE_MM
    assert np.mean([estimate["error_mm"] for estimate in estimates]) < 4
