"""`abs-service export x.glb`: its poses, read by the format's rules, are the meshes of the recording."""

import json

import numpy as np
import pytest

from abs_service import cli
from abs_service.export import animation
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    SIMULATION,
    version,
    vertices,
    write_estimated,
)

#: Estimates of the recording's meshes.
POSES = {0: (1, 2, 3, 4), 1: (5,)}


@pytest.fixture
def path(tmp_path):
    recording, out = write_estimated(tmp_path / "x.mcap"), tmp_path / "x.glb"
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.OK
    return out


def read(path):
    """The document of a GLB file, and a function that gives the numbers of an accessor."""
    data = path.read_bytes()
    size = int.from_bytes(data[12:16], "little")
    document, binary = json.loads(data[20 : 20 + size]), data[28 + size :]

    def numbers(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        assert view["byteLength"] == 4 * accessor["count"] * width
        return np.frombuffer(binary, kind, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)

    return document, numbers


def channels(document, numbers, node):
    """Times and values of the animated properties of a node."""
    (motion,) = document["animations"]
    found = {}
    for one in motion["channels"]:
        if one["target"]["node"] == node:
            sampler = motion["samplers"][one["sampler"]]
            found[one["target"]["path"]] = numbers(sampler["input"])[:, 0], numbers(sampler["output"])
    return found


def test_each_pose_is_shown_at_its_time(path):
    document, numbers = read(path)
    assert document["nodes"][0]["children"] == [1, 2]
    np.testing.assert_array_equal(document["nodes"][0]["rotation"], [1, 0, 0, 0])  # y up, z to the viewer
    shown = []
    for mesh, own in POSES.items():
        (part,) = document["meshes"][mesh]["primitives"]
        base = numbers(part["attributes"]["POSITION"])
        targets = np.array([numbers(one["POSITION"]) for one in part["targets"]])
        np.testing.assert_array_equal(numbers(part["indices"]).reshape(-1, 3), FACES[version(own[0])])
        found = channels(document, numbers, 1 + mesh)
        times, scale = found["scale"]
        weights = found["weights"][1].reshape(len(times), len(targets))
        for k in range(len(times)):
            if (scale[k] == 1).all():
                shown.append(k + 1)
                pose = base + np.tensordot(weights[k], targets, 1)
                np.testing.assert_allclose(pose, vertices(k + 1), atol=1e-6)
                assert times[k] == pytest.approx((SIMULATION.time_ns(k + 1) - SIMULATION.time_ns(1)) * 1e-9)
            else:
                assert (scale[k] == 0).all()
    assert shown == [1, 2, 3, 4, 5]


def test_another_reader_opens_it(path):
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(path)
    assert sorted(scene.geometry) == ["GLTF", "GLTF_1"]
    first = scene.geometry["GLTF"]
    np.testing.assert_allclose(first.vertices, vertices(1), rtol=1e-6)
    np.testing.assert_array_equal(first.faces, FACES[1])


def test_many_estimates_are_thinned_out_evenly(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(animation, "POSES", 3)
    recording, out = write_estimated(tmp_path / "x.mcap"), tmp_path / "x.glb"
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.OK
    assert "3 of 6 estimates of sheet" in capsys.readouterr().out
    document, numbers = read(out)
    times = channels(document, numbers, 1)["weights"][0]
    np.testing.assert_allclose(times, [(SIMULATION.time_ns(k) - SIMULATION.time_ns(1)) * 1e-9 for k in (1, 3, 5)])
