"""`abs-service export` of estimates: each format, read by another reader, has the numbers of the recording."""

import csv

import numpy as np
import pytest

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    SIMULATION,
    STATUSES,
    theta,
    version,
    vertices,
    write_estimated,
)
from tests.abs_service.commands.recordings.simulated_recording import write_take


@pytest.fixture
def recording(tmp_path):
    return write_estimated(tmp_path / "x.mcap")


def export(recording, out):
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.OK
    return out


def test_a_table_has_theta_sigma_and_status(recording, tmp_path):
    with export(recording, tmp_path / "x.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["status"] for row in rows] == list(STATUSES)
    assert [float(row["time_s"]) for row in rows] == pytest.approx([SIMULATION.time_ns(k) * 1e-9 for k in range(6)])
    assert (rows[0]["theta_0"], rows[0]["sigma_1"], rows[4]["sigma_0"]) == ("", "", "")
    assert [float(rows[k][f"theta_{i}"]) for k in range(1, 6) for i in range(2)] == list(
        np.concatenate([theta(k) for k in range(1, 6)])
    )
    assert [float(rows[1][name]) for name in ("sigma_0", "sigma_1", "deviation_m")] == [2.0, 3.0, 3.0]
    assert rows[3]["reasons"] == "no frame from color"


def test_arrays_have_what_was_recorded(recording, tmp_path):
    with np.load(export(recording, tmp_path / "x.npz")) as found:
        assert list(found["status"]) == list(STATUSES)
        assert list(found["mesh"]) == [-1, 0, 0, 0, 0, 1]
        assert (found["theta"].shape, found["covariance"].shape) == ((6, 2), (6, 2, 2))
        assert (found["vertices"].shape, found["vertex_covariance"].shape) == ((6, 4, 3), (6, 4, 3, 3))
        for k in range(6):
            size = len(vertices(k))
            np.testing.assert_array_equal(found["vertices"][k, :size], vertices(k))
            assert np.isnan(found["vertices"][k, size:]).all()
            if version(k):
                np.testing.assert_array_equal(found["theta"][k], theta(k))
                np.testing.assert_array_equal(found[f"faces_{found['mesh'][k]}"], FACES[version(k)])
        np.testing.assert_array_equal(found["vertex_covariance"][1, 0], np.diag([1, 4, 4]))
        np.testing.assert_array_equal(found["covariance"][1], np.diag([4, 9]))
        assert np.isnan(found["covariance"][4]).all()  # LOST


def test_a_parquet_file_has_the_columns_of_the_table(recording, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    found = parquet.read_table(export(recording, tmp_path / "x.parquet"))
    with export(recording, tmp_path / "x.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert found.column_names == list(rows[0])
    assert {name: str(found.schema.field(name).type) for name in ("time_s", "status", "evaluations", "theta_0")} == {
        "time_s": "double",
        "status": "string",
        "evaluations": "int64",
        "theta_0": "double",
    }
    for row, expected in zip(found.to_pylist(), rows, strict=True):
        assert ["" if value is None else str(value) for value in row.values()] == list(expected.values())


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_a_series_has_a_mesh_for_each_estimate_that_has_one(recording, tmp_path, suffix):
    trimesh = pytest.importorskip("trimesh")
    folder = export(recording, tmp_path / "meshes" / f"sheet.{suffix}").parent
    assert sorted(path.name for path in folder.iterdir()) == [f"sheet_{k:06d}.{suffix}" for k in range(1, 6)]
    for k in range(1, 6):
        mesh = trimesh.load(folder / f"sheet_{k:06d}.{suffix}", process=False, maintain_order=True)
        np.testing.assert_allclose(mesh.vertices, vertices(k), rtol=1e-6)
        np.testing.assert_array_equal(mesh.faces, FACES[version(k)])


def test_a_series_names_its_files_and_replaces_nothing(recording, tmp_path, capsys):
    out = export(recording, tmp_path / "meshes" / "sheet.ply")
    assert capsys.readouterr().out.startswith(f"{tmp_path}/meshes/sheet_*.ply: 6 estimates of sheet")
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.USER
    assert "sheet_000001.ply is there already" in capsys.readouterr().err


def test_a_file_where_the_folder_of_a_series_should_be_is_named(recording, tmp_path, capsys):
    (tmp_path / "meshes").write_text("mine")
    out = tmp_path / "meshes" / "sheet.ply"
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.USER
    assert f"error: --out {out}: {out.parent} is no folder\n" in capsys.readouterr().err


def test_what_breaks_off_is_exported_up_to_there(tmp_path, capsys):
    recording = write_estimated(tmp_path / "x.mcap", finish=False)
    export(recording, tmp_path / "x.csv")
    assert "was never finished" in capsys.readouterr().err
    assert len((tmp_path / "x.csv").read_text().splitlines()) == 7


def test_a_recording_without_estimates_says_so_and_leaves_nothing(tmp_path, capsys):
    simulation = parse("simulated://sheet?tof=32x24&sensors=tof").build()
    recording = write_take(tmp_path / "x.mcap", simulation, range(2), {"tof": "tof"})
    assert cli.main(["export", str(recording), "--out", str(tmp_path / "x.csv")]) == Exit.USER
    assert "x.mcap has no estimates; `abs-service replay` makes them" in capsys.readouterr().err
    assert cli.main(["export", str(recording), "--out", str(tmp_path / "x.npz"), "--tracker", "y"]) == Exit.USER
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.mcap"]
