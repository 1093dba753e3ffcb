"""The example applications do what they say, against a real zenoh router."""

import os
import re
import signal
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path
from shutil import which

import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from abs_service.bus import keys
from abs_service.bus.contract import MESH, STATE
from tests.abs_service.wire.golden.freeze import BINARY
from tests.waiting import repeating

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"

#: Between two publications [s]. They go on until the reader has seen enough: nobody knows when it has subscribed.
PERIOD_S = 0.02
#: By when a reader must have printed what it should [s]; it is killed then.
TIMEOUT_S = 30.0


def test_the_subscriber_prints_estimates_and_ends(endpoint, open_bus):
    state = golden(DeformationState)
    states = open_bus().publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    with reading(python("subscribe.py", "--endpoint", endpoint, "--count", 2)) as reader, putting(states, state):
        output, errors = reader.communicate(timeout=TIMEOUT_S)
    assert (reader.returncode, errors) == (0, "")
    assert_printed(output.splitlines(), state)


def test_the_subscriber_ends_at_once_with_ctrl_c(endpoint, open_bus):
    states = open_bus().publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    with reading(python("subscribe.py", "--endpoint", endpoint)) as reader:
        with putting(states, golden(DeformationState)):
            assert next(printed(reader))
        reader.send_signal(signal.SIGINT)  # it waits for the next estimate now, and none will come
        _, errors = reader.communicate(timeout=TIMEOUT_S)
    assert (reader.returncode, errors) == (0, "")


def test_the_subscriber_ends_silently_when_its_reader_has_seen_enough(endpoint, open_bus):
    states = open_bus().publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    with reading(python("subscribe.py", "--endpoint", endpoint)) as reader, putting(states, golden(DeformationState)):
        assert next(printed(reader))
        assert reader.stdout
        assert reader.stderr
        reader.stdout.close()
        assert reader.stderr.read() == ""
        assert reader.wait(TIMEOUT_S) == 0


def test_the_subscriber_reports_a_missing_service(endpoint):
    with reading(python("subscribe.py", "--endpoint", endpoint)) as reader:
        _, errors = reader.communicate(timeout=TIMEOUT_S)
    assert reader.returncode == 1
    assert errors == f"nothing answers at {endpoint}: is abs-service running?\n"


def test_meshes_become_arrays_also_after_the_tracker_was_restarted(endpoint, open_bus):
    state, topology, mesh = golden(DeformationState), golden(MeshTopology), golden(DeformedMesh)
    mesh.vertices_f32 = topology.rest_vertices_f32
    mesh.ClearField("covariance_f32")  # of another number of vertices
    bus = open_bus()
    topologies = bus.latched_publisher(keys.topology("sheet"), MeshTopology.DESCRIPTOR.full_name)
    states = bus.publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    meshes = bus.publisher(keys.mesh("sheet"), DeformedMesh.DESCRIPTOR.full_name, MESH)
    topologies.put(topology.SerializeToString())
    with reading(python("mesh.py", "--endpoint", endpoint)) as reader:
        with putting(states, state), putting(meshes, mesh):
            half = "50.0 cm², farthest moved    0.0 mm"  # of 10 cm × 10 cm
            assert any(half in line for line in printed(reader))
        topology.header.boot_id = mesh.header.boot_id = state.header.boot_id = "another"
        topology.faces_u32 *= 2
        topologies.put(topology.SerializeToString())
        with putting(states, state), putting(meshes, mesh):
            assert any("100.0 cm²" in line for line in printed(reader))
        reader.send_signal(signal.SIGINT)
        _, errors = reader.communicate(timeout=TIMEOUT_S)
    assert (reader.returncode, errors) == (0, "")


@pytest.mark.parametrize("name", ["subscribe.py", "mesh.py"])
def test_an_example_is_short_and_needs_nothing_of_the_service(name):
    text = (EXAMPLES / name).read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 40
    assert "abs_service" not in text


def test_the_subscriber_in_cpp_is_built_with_all_messages_that_an_estimate_contains():
    files, needed = [DeformationState.DESCRIPTOR.file], set()
    while files:
        needed.add(files[-1].name)
        files += [one for one in files.pop().dependencies if one.name.startswith("absmsg")]
    listed = re.search(r"set\(MESSAGES (.+?)\)", (EXAMPLES / "cpp" / "CMakeLists.txt").read_text("utf-8"))
    assert listed
    assert {f"absmsg/v1/{name}.proto" for name in listed[1].split()} == needed


@pytest.mark.slow
def test_the_subscriber_in_cpp_does_the_same(endpoint, open_bus, tmp_path):
    program = build_cpp(tmp_path)
    state = golden(DeformationState)
    state.covariance.extend([0.5] * 1176)  # as large as an estimate with 48 parameters: zenoh-pico has limits
    states = open_bus().publisher(keys.state("sheet"), DeformationState.DESCRIPTOR.full_name, STATE)
    with reading([program, endpoint, "abs/demo/sheet/state", "2"]) as reader, putting(states, state):
        output, errors = reader.communicate(timeout=TIMEOUT_S)
    assert (reader.returncode, errors) == (0, "")
    assert_printed(output.replace("STATUS_", "").replace("theta", "Θ").splitlines(), state)


def assert_printed(lines, state):
    assert len(lines) == 2
    for line in lines:
        assert line.split()[:5] == [str(state.header.seq), "DEGRADED", "published", f"{state.age_ms:.1f}", "ms,"]
        assert f"Θ[{len(state.theta)}] = {state.theta[0]:+.3f}" in line


def build_cpp(folder):
    missing = [tool for tool in ("cmake", "protoc", "c++") if which(tool) is None]
    if missing:
        pytest.skip(f"not installed: {', '.join(missing)}")
    source = os.environ.get("ABS_ZENOH_PICO")
    if source is None:
        pytest.skip("no source of zenoh-pico; name its folder with ABS_ZENOH_PICO")
    subprocess.run(
        ["cmake", "-S", EXAMPLES / "cpp", "-B", folder, f"-DFETCHCONTENT_SOURCE_DIR_ZENOHPICO={source}"],
        check=True,
        capture_output=True,
    )
    subprocess.run(["cmake", "--build", folder, "--parallel", "2"], check=True, capture_output=True)
    return folder / "subscribe"


def golden(message):
    return message.FromString((BINARY / f"{message.DESCRIPTOR.name}.bin").read_bytes())


def python(example, *arguments):
    return [sys.executable, EXAMPLES / example, *map(str, arguments)]


def printed(reader):
    return iter(reader.stdout or ())


@contextmanager
def reading(command):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, env=environment) as reader:
        watchdog = threading.Timer(TIMEOUT_S, reader.kill)
        watchdog.start()
        try:
            yield reader
        finally:
            watchdog.cancel()
            reader.kill()


def putting(publisher, message):
    return repeating(lambda: publisher.put(message.SerializeToString()), PERIOD_S)
