"""`abs-service export x.rrd`: read with Rerun's own reader, it has what was recorded."""

import io
import subprocess
import sys
from collections import defaultdict

import numpy as np
import pytest
from PIL import Image

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    SIMULATION,
    STATUSES,
    version,
    vertices,
    write_estimated,
)
from tests.abs_service.export.incomplete_recording import write_without

chunk = pytest.importorskip("rerun.chunk")

TIMES = [SIMULATION.time_ns(k) for k in range(6)]


def export(recording, out):
    assert cli.main(["export", str(recording), "--out", str(out), "--view-hz", "1000"]) == Exit.OK
    return read(out)


def read(path):
    """Values of each component of each entity, by time [ns]; of what does not change by None."""
    found = defaultdict(dict)
    assert len(chunk.RrdReader(path).blueprints()) == 1
    for part in chunk.RrdReader(path).stream():
        batch = part.to_record_batch()
        assert part.timeline_names == ([] if part.is_static else ["time"])
        times = [None] * part.num_rows if part.is_static else batch["time"].cast("int64").to_pylist()
        for name in batch.schema.names:
            archetype, _, component = name.partition(":")
            if component and archetype != "rerun.controls":
                values = zip(times, batch[name].to_pylist())
                found[part.entity_path, component] |= {time: value for time, value in values if value is not None}
    return found


@pytest.fixture
def found(tmp_path):
    return export(write_estimated(tmp_path / "x.mcap"), tmp_path / "x.rrd")


def test_meshes_status_and_numbers(found):
    meshes = found["/sheet/mesh", "vertex_positions"]
    assert sorted(meshes) == TIMES[1:]
    for k in range(1, 6):
        np.testing.assert_array_equal(meshes[TIMES[k]], vertices(k))
        np.testing.assert_array_equal(found["/sheet/mesh", "triangle_indices"][TIMES[k]], FACES[version(k)])
    texts = found["/sheet/status", "text"]
    assert [texts[time][0].partition(":")[0] for time in TIMES] == list(STATUSES)
    assert texts[TIMES[3]] == ["DEGRADED: no frame from color"]
    deviations = found["/sheet/deviation_m", "scalars"]
    assert [deviations[TIMES[k]][0] for k in (1, 2)] == [3.0, 3.0]


def test_cameras_images_and_points(found):
    camera = SIMULATION.heads["tof"].camera
    matrix = np.reshape(found["/cameras/tof", "image_from_camera"][None], (3, 3)).T
    np.testing.assert_allclose(matrix, [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]], rtol=1e-6)
    np.testing.assert_allclose(found["/cameras/color", "translation"][None][0], camera_place("color"), atol=1e-7)
    for k, time in enumerate(TIMES):
        frames = {frame.key: frame for frame in SIMULATION.frames(k)}
        radial = frames["tof", "depth"].si()
        v, u = np.mgrid[:24, :32]
        sight = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)
        z = radial / np.linalg.norm(sight, axis=-1)
        shown = np.frombuffer(bytes(found["/images/tof/depth", "buffer"][time][0]), "<f4").reshape(24, 32)
        np.testing.assert_allclose(shown, np.nan_to_num(z), rtol=1e-5)
        points = np.array(found["/points/tof", "positions"][time])
        np.testing.assert_allclose(points, (sight * z[..., None])[np.isfinite(z)], rtol=1e-4, atol=1e-6)
        color = np.asarray(Image.open(io.BytesIO(bytes(found["/images/color/color", "blob"][time][0]))))
        assert np.abs(color.astype(float) - frames["color", "color"].data).mean() < 12


def camera_place(head):
    """Centre of a camera in the rig (3,) [m]."""
    return SIMULATION.heads[head].camera.T_rs[:3, 3]


def test_estimates_alone_have_no_images(tmp_path):
    found = export(write_without(tmp_path, "image"), tmp_path / "x.rrd")
    assert sorted(found["/sheet/mesh", "vertex_positions"]) == TIMES[1:]
    assert not [entity for entity, _ in found if entity.startswith("/images")]


def test_a_disk_that_does_not_take_all_of_it_is_told_and_leaves_no_file(tmp_path):
    recording = write_estimated(tmp_path / "x.mcap")
    limit = f"ulimit -f 8; trap '' XFSZ; exec {sys.executable} -m abs_service export {recording} --out {tmp_path}/x.rrd"
    ended = subprocess.run(["sh", "-c", limit], capture_output=True, text=True, timeout=60, check=False)
    assert (ended.returncode, ended.stdout) == (Exit.USER, "")
    assert ended.stderr == f"abs-service: error: {tmp_path}/x.rrd: File too large\n"
    assert not list(tmp_path.glob("*.rrd*"))
