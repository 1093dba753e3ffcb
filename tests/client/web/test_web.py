"""`abs-web`: what JavaScript receives of a rig, in Python, Node and a browser."""

import base64
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from abs_client.connection.link import Link
from abs_client.web import program
from abs_client.web.server import EstimateServer
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology

from abs_service.bus import keys
from abs_service.bus.contract import MESH, STATE
from tests.abs_service.wire.golden.freeze import BINARY
from tests.client.publishing import PERIOD_S, estimating
from tests.waiting import repeating

NODE_PROGRAM = Path(__file__).parents[3] / "examples" / "javascript" / "states.mjs"
TIMEOUT_S = 60.0


@contextmanager
def serving(endpoint, origin=""):
    """Address of a server."""
    with Link(endpoint, "demo") as link, EstimateServer(("127.0.0.1", 0), link, 0.5, origin) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        link.close()
        server.shutdown()
        thread.join()


@pytest.fixture
def address(tracker, bus, endpoint):
    bus.declare_liveliness("track/sheet")
    with serving(endpoint) as address:
        yield address


def golden(message):
    return message.FromString((BINARY / f"{message.DESCRIPTOR.name}.bin").read_bytes())


def received(address, tracker, count):
    """The first events, by name."""
    with urllib.request.urlopen(f"{address}/states/{tracker}", timeout=TIMEOUT_S) as answer:
        assert answer.headers["Content-Type"] == "text/event-stream"
        for _ in range(count):
            name, data, empty = (answer.readline().decode() for _ in range(3))
            assert empty == "\n"
            yield name.removeprefix("event: ").strip(), json.loads(data.removeprefix("data: "))


def test_faces_come_before_the_first_estimate_of_a_mesh(tracker, address):
    with estimating(tracker, age_s=0.1):
        (first, topology), (second, state) = received(address, "sheet", 2)
    assert (first, second) == ("topology", "state")
    vertices = np.frombuffer(base64.b64decode(state["vertices"]), "<f4").reshape(-1, 3)
    np.testing.assert_array_equal(vertices, tracker.vertices)
    assert np.frombuffer(base64.b64decode(topology["faces"]), "<u4").tolist() == [0, 1, 2] * (tracker.size - 2)
    assert (state["status"], state["theta"], state["mesh_version"]) == ("TRACKING", [0.5], topology["mesh_version"])
    assert 0.1 <= state["age_s"] < 0.5


def test_a_new_mesh_has_new_faces(tracker, address):
    sizes = []
    with estimating(tracker):
        for name, content in received(address, "sheet", 10**6):
            if name == "topology":
                sizes.append(len(base64.b64decode(content["faces"])) // 12)
                tracker.remesh()
            if len(sizes) == 2:
                break
    assert sizes[1] == sizes[0] + 1


def test_a_tracker_without_estimates_is_stale_and_has_no_age(address):
    ((name, state),) = received(address, "cloth", 1)
    assert (name, state["status"], state["age_s"], state["vertices"]) == ("state", "STALE", None, "")
    assert state["reasons"] == ["nothing was received of tracker cloth of rig demo yet; there are sheet of rig demo"]


def test_the_trackers_that_live(address):
    with urllib.request.urlopen(f"{address}/trackers", timeout=TIMEOUT_S) as answer:
        assert json.load(answer) == ["sheet"]
        assert answer.headers["Access-Control-Allow-Origin"] is None


@pytest.mark.parametrize("path", ["/states/**", "/states/", "/else"])
def test_what_is_not_there_is_refused(address, path):
    with pytest.raises(urllib.error.HTTPError, match="404") as refused:
        urllib.request.urlopen(address + path, timeout=TIMEOUT_S)
    refused.value.close()


def test_who_asks_nothing_is_let_go(bus, endpoint, monkeypatch):
    with Link(endpoint, "demo") as link, EstimateServer(("127.0.0.1", 0), link, 0.5, "") as server:
        handler: Any = server.RequestHandlerClass
        assert handler.timeout == 10
        monkeypatch.setattr(handler, "timeout", 0.1)
        with socket.create_connection(("127.0.0.1", server.server_port), TIMEOUT_S) as idle:
            server.handle_request()
            assert idle.recv(1) == b"", "closed"


def test_estimates_of_a_closed_link_are_an_error_and_no_stream(bus, endpoint):
    with Link(endpoint, "demo") as link, EstimateServer(("127.0.0.1", 0), link, 0.5, "") as server:
        link.close()
        threading.Thread(target=server.handle_request).start()
        with pytest.raises(urllib.error.HTTPError, match="502") as refused:
            urllib.request.urlopen(f"http://127.0.0.1:{server.server_port}/states/sheet", timeout=TIMEOUT_S)
        refused.value.close()


def test_a_page_elsewhere_reads_only_if_it_is_named(bus, endpoint):
    origin = "http://localhost:3000"
    with serving(endpoint, origin) as address, urllib.request.urlopen(f"{address}/trackers") as answer:
        assert answer.headers["Access-Control-Allow-Origin"] == origin


def test_node_prints_estimates(tracker, address):
    node = shutil.which("node")
    if node is None:
        pytest.skip("not installed: node")
    with estimating(tracker):
        done = subprocess.run(
            [node, NODE_PROGRAM, address, "sheet", "2"], capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert len(lines) == 2
    assert all(f"{tracker.size} vertices, Θ[1] = 0.500" in line and " TRACKING " in line for line in lines)


def test_node_prints_the_golden_estimate(bus, endpoint):
    node = shutil.which("node")
    if node is None:
        pytest.skip("not installed: node")
    state, topology, mesh = golden(DeformationState), golden(MeshTopology), golden(DeformedMesh)
    mesh.vertices_f32 = topology.rest_vertices_f32
    mesh.ClearField("covariance_f32")  # of another number of vertices
    bus.latched_publisher(keys.topology("sheet"), topology.DESCRIPTOR.full_name).put(topology.SerializeToString())
    states = bus.publisher(keys.state("sheet"), state.DESCRIPTOR.full_name, STATE)
    meshes = bus.publisher(keys.mesh("sheet"), mesh.DESCRIPTOR.full_name, MESH)

    def publish():
        states.put(state.SerializeToString())
        meshes.put(mesh.SerializeToString())

    command = [node, NODE_PROGRAM]
    with serving(endpoint) as address, repeating(publish, PERIOD_S):
        command += [address, "sheet", "3"]  # before it nothing may have come, and after it comes nothing new: STALE
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=True)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("42 DEGRADED here "))
    assert line.endswith(f" {len(topology.rest_vertices_f32) // 12} vertices, Θ[3] = 0.000 -0.250 0.001")


@pytest.mark.slow
def test_a_browser_shows_theta_and_draws_the_mesh(tracker, address, browser):
    page = browser.new_page()
    page.set_default_timeout(1e3 * TIMEOUT_S)
    page.goto(address)
    blank = page.locator("canvas").screenshot()
    with estimating(tracker):
        page.get_by_text("Θ[1] = 0.500").wait_for()
        page.get_by_text("TRACKING").wait_for()
        drawn = page.locator("canvas").screenshot()
    page.get_by_text("STALE").wait_for()
    assert drawn != blank


def test_the_program_serves_until_it_is_told_to_end(bus, endpoint):
    command = [sys.executable, "-m", "abs_client.web", "--endpoint", endpoint, "--port", "0"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        said = next(iter(process.stdout or ()))
        with urllib.request.urlopen(said.split()[-1], timeout=TIMEOUT_S) as answer:
            assert b"EventSource" in answer.read()
        process.send_signal(signal.SIGTERM)
        assert process.wait(TIMEOUT_S) == 0


def test_a_port_that_is_taken_is_told(bus, endpoint, capsys):
    with serving(endpoint) as address:
        port = address.rpartition(":")[2]
        assert program.main(["--endpoint", endpoint, "--port", port]) == 2
    assert f"--port {port}: Address already in use; choose another" in capsys.readouterr().err


def test_a_rig_that_is_not_there_is_told(endpoint, capsys):
    assert program.main(["--endpoint", endpoint]) == 2
    assert f"nothing answers at {endpoint}" in capsys.readouterr().err


@pytest.mark.parametrize("age", ["0", "x"])
def test_an_age_that_no_estimate_has_is_told(capsys, age):
    with pytest.raises(SystemExit, match="2"):
        program.main(["--maximum-age", age])
    assert f"'{age}' is no age: a number of seconds greater than 0" in capsys.readouterr().err
