"""The example applications do what they say, against a real zenoh router."""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from abs.v1.deformation_state_pb2 import DeformationState

from abs_service import keys
from abs_service.bus.contract import STATE

ROOT = Path(__file__).parents[2]
SUBSCRIBE = ROOT / "examples" / "subscribe.py"


def test_the_subscriber_prints_estimates_and_ends(endpoint, open_bus):
    state = DeformationState.FromString((ROOT / "tests" / "golden" / "DeformationState.bin").read_bytes())
    publisher = open_bus().publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    command = [sys.executable, str(SUBSCRIBE), "--endpoint", endpoint, "--count", "2"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as reader:
        for _ in range(300):
            publisher.put(state.SerializeToString())
            with suppress(subprocess.TimeoutExpired):
                reader.wait(0.05)
                break
        reader.kill()
        output, _ = reader.communicate()
    assert reader.returncode == 0
    lines = output.splitlines()
    assert len(lines) == 2
    assert f"{state.header.seq} DEGRADED" in lines[0]
    assert f"Θ[{len(state.theta)}]" in lines[0]


def test_the_subscriber_is_short_and_needs_nothing_of_the_service():
    text = SUBSCRIBE.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40
    assert "abs_service" not in text
