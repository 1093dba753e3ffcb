"""`abs-service import` makes a recording that can be replayed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.replay import Recording
from tests.abs_service.commands.images.importing import frames_of, open3d, run
from tests.drivers.o3r import pcic_messages
from tests.drivers.sens.sens_file import OCCI, SensFile, shots


def test_pairs_become_a_recording(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = folder / "rig.toml"
    rig.write_text('version = 1\nname = "cloth"\n')
    camera = str(folder / "camera.toml")
    assert run(folder, "--camera", camera, "--rate", "10", "--rig", str(rig), "--mask", "mask_*.png") == Exit.OK
    assert "3 depth, 2 color images" in capsys.readouterr().out
    recording = Recording(folder / "out.mcap")
    assert recording.config == rig.read_text()
    assert recording.counts == {("depth", "depth"): 3, ("color", "color"): 2}
    assert recording.cameras["color"].center.tolist() == [0.05, 0, 0]
    frames = frames_of(folder / "out.mcap")
    assert [(frame.sensor, frame.seq, frame.t_host_ns) for frame in frames] == [
        ("depth", 0, 0),
        ("color", 0, 0),
        ("depth", 1, 100_000_000),
        ("depth", 2, 200_000_000),
        ("color", 2, 200_000_000),
    ]
    assert (frames[2].scale, frames[2].geometry) == (0.001, Geometry.Z)
    np.testing.assert_array_equal(np.isfinite(frames[2].si()), np.eye(3, 4, dtype=bool))


def test_the_same_images_give_the_same_bytes(folder: Path) -> None:
    run(folder, "--camera", str(folder / "camera.toml"))
    first = (folder / "out.mcap").read_bytes()
    (folder / "out.mcap").unlink()
    run(folder, "--camera", str(folder / "camera.toml"))
    assert (folder / "out.mcap").read_bytes() == first


def test_a_camera_file_may_be_json_and_say_more_about_depth(folder: Path) -> None:
    depth = {"width": 4, "height": 3, "fx": 4, "fy": 4, "cx": 1.5, "cy": 1, "lens": [-0.1, 0.01]}
    depth |= {"depth_scale": 0.0001, "geometry": "radial", "invalid": 1001}
    (folder / "camera.json").write_text(json.dumps({"depth": depth}))
    assert run(folder, "--camera", str(folder / "camera.json")) == Exit.OK
    frames = frames_of(folder / "out.mcap")
    assert {frame.sensor for frame in frames} == {"depth"}
    assert (frames[0].scale, frames[0].geometry, frames[0].invalid) == (0.0001, Geometry.RADIAL, 1001)
    assert not np.any(np.isfinite(frames[1].si()))
    assert Recording(folder / "out.mcap").cameras["depth"].lens.coefficients[:2].tolist() == [-0.1, 0.01]


def test_a_camera_file_may_describe_a_fisheye(folder: Path) -> None:
    depth = {"width": 4, "height": 3, "fx": 4, "fy": 4, "cx": 1.5, "cy": 1, "lens": [-0.1], "lens_model": "fisheye"}
    (folder / "camera.json").write_text(json.dumps({"depth": depth}))
    assert run(folder, "--camera", str(folder / "camera.json")) == Exit.OK
    lens = Recording(folder / "out.mcap").cameras["depth"].lens
    assert (lens.name, lens.coefficients.tolist()) == ("fisheye", [-0.1, 0, 0, 0])


def test_a_benchmark_sequence_needs_no_camera_file(tmp_path: Path) -> None:
    for name, image in (("depth", np.full((480, 640), 5000, np.uint16)), ("rgb", np.zeros((480, 640, 3), np.uint8))):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
        (tmp_path / f"{name}.txt").write_text(f"1305031102.5 {name}.png\n")
    assert cli.main(["import", str(tmp_path), "--layout", "tum", "--out", str(tmp_path / "out.mcap")]) == Exit.OK
    depth, _ = frames_of(tmp_path / "out.mcap")
    assert depth.si()[0, 0] == 1.0
    assert depth.t_host_ns == 1_305_031_102_500_000_000
    assert Recording(tmp_path / "out.mcap").cameras["depth"].fx == 525


@pytest.mark.parametrize(
    ("name", "changes", "metres"),
    [("camera_intrinsic.json", {}, 2.0), ("intrinsic.json", {"depth_scale": 4000.0, "fps": 30.0}, 0.5)],
)
def test_a_folder_of_open3d_brings_its_camera(tmp_path: Path, name, changes, metres) -> None:
    assert cli.main(open3d(tmp_path, name, **changes)) == Exit.OK
    depth, color = frames_of(tmp_path / "out.mcap")
    assert (depth.si()[0, 0], depth.seq, depth.kind, color.kind) == (metres, 7, Kind.DEPTH, Kind.COLOR)
    cameras = Recording(tmp_path / "out.mcap").cameras
    for camera in (cameras["depth"], cameras["color"]):
        assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.lens.is_pinhole) == (4, 5, 1.5, 1, True)


def test_a_recording_of_another_program_brings_its_calibration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "o3r.data").write_bytes(pcic_messages.exposure(3) + pcic_messages.exposure(4))
    arguments = ["import", str(tmp_path / "o3r.data"), "--layout", "o3r", "--out", str(tmp_path / "out.mcap")]
    assert cli.main([*arguments, "--camera", "camera.toml"]) == Exit.USER
    assert "--camera: layout o3r takes no options but --out" in capsys.readouterr().err
    assert cli.main(arguments) == Exit.OK
    assert "2 depth, 2 depth/deviation, 2 depth/amplitude, 2 depth/confidence images" in capsys.readouterr().out
    recording = Recording(tmp_path / "out.mcap")
    assert recording.cameras["depth"].fx == pcic_messages.LENS[0]
    deviations = [frame for frame in frames_of(tmp_path / "out.mcap") if frame.kind == Kind.DEVIATION]
    assert [frame.unit for frame in deviations] == ["m", "m"]


def sens(folder: Path, *options: str, **changes: Any) -> int:
    """Imports a file of four frames; its exit code."""
    (folder / "scene.sens").write_bytes(SensFile(shots(4), **changes).content())
    return cli.main(
        ["import", str(folder / "scene.sens"), "--layout", "sens", "--out", str(folder / "out.mcap"), *options]
    )


def test_a_scan_becomes_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sens(tmp_path, "--frames", "1:3:2") == Exit.OK
    output = capsys.readouterr()
    assert "2 depth, 2 color images" in output.out
    assert "scene.sens: time stamps do not increase" in output.err
    assert "30 frames per second are assumed; --rate gives another rate" in output.err
    recording = Recording(tmp_path / "out.mcap")
    assert (recording.cameras["depth"].fx, recording.cameras["color"].fx) == (7, 9)
    np.testing.assert_allclose(np.linalg.norm(recording.cameras["color"].center), 0.0251, atol=1e-4)
    frames = frames_of(tmp_path / "out.mcap")
    assert [(frame.sensor, frame.seq, frame.t_host_ns) for frame in frames] == [
        ("depth", 1, 33_333_333),
        ("color", 1, 33_333_333),
        ("depth", 3, 100_000_000),
        ("color", 3, 100_000_000),
    ]
    np.testing.assert_allclose(frames[2].si()[0, :3], [np.nan, 1.004, 1.005], rtol=1e-6)
    assert frames[1].data[0, 0].tolist() == [11, 100, 200]


def test_a_scan_may_have_a_rate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sens(tmp_path, "--rate", "10") == Exit.OK
    assert "time stamps" not in capsys.readouterr().err
    assert frames_of(tmp_path / "out.mcap")[-1].t_host_ns == 300_000_000


@pytest.mark.parametrize(
    ("options", "changes", "complaint"),
    [
        ([], {"depth_compression": OCCI}, "scene.sens: depth_compression_type = 2 (occi_ushort): only 0 (raw_ushort)"),
        ([], {"count": 9}, "scene.sens: frame 4 of 9 is cut off"),
        (["--frames", "7:9"], {}, "scene.sens: it has none of the frames that were asked for; there are 0 to 3"),
        (["--camera", "x.toml"], {}, "--camera: layout sens takes --rate, --frames"),
    ],
)
def test_a_scan_that_cannot_be_read_is_refused(tmp_path: Path, capsys, options, changes, complaint) -> None:
    assert sens(tmp_path, *options, **{"inertial": 0, **changes}) == Exit.USER
    assert complaint in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["scene.sens"]


@pytest.mark.parametrize(
    ("frames", "depths", "colors"),
    [
        ("1:2", [1, 2], [2]),
        ("1:", [1, 2], [2]),
        (":1", [0, 1], [0]),
        ("0:2:2", [0, 2], [0, 2]),
        ("0,2", [0, 2], [0, 2]),
        ("2", [2], [2]),
        ("0:99", [0, 1, 2], [0, 2]),
    ],
)
def test_a_part_of_the_exposures(folder: Path, frames: str, depths: list[int], colors: list[int]) -> None:
    camera = str(folder / "camera.toml")
    assert run(folder, "--camera", camera, "--frames", frames, "--mask", "mask_*.png") == Exit.OK
    found = frames_of(folder / "out.mcap")
    assert [frame.seq for frame in found if frame.sensor == "depth"] == depths
    assert [frame.seq for frame in found if frame.sensor == "color"] == colors
    assert {frame.t_host_ns for frame in found} == {round(seq * 1e9 / 30) for seq in depths}


def test_a_part_of_a_list_has_the_colours_of_its_moments(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), np.full((480, 640), 5000, np.uint16))
    cv2.imwrite(str(tmp_path / "c.png"), np.zeros((480, 640, 3), np.uint8))
    for name, image, late in (("depth", "d", 0.0), ("rgb", "c", 0.01)):
        for k in range(5):
            (tmp_path / f"{image}{k}.png").write_bytes((tmp_path / f"{image}.png").read_bytes())
        lines = [f"{10 + k / 30 + late:.6f} {image}{k}.png\n" for k in range(5)]
        (tmp_path / f"{name}.txt").write_text("".join(lines))
    out = tmp_path / "out.mcap"
    assert cli.main(["import", str(tmp_path), "--layout", "tum", "--out", str(out), "--frames", "1:4:2"]) == Exit.OK
    assert [(frame.sensor, frame.seq) for frame in frames_of(out)] == [
        ("depth", 1),
        ("color", 1),
        ("depth", 3),
        ("color", 3),
    ]


def test_a_real_sequence_of_a_squeezed_toy(data_set: Callable[[str], Path], tmp_path: Path) -> None:
    """PrimeSense-like camera, 320 × 240, a soft toy on a table about 0.6 to 1.5 m away."""
    (tmp_path / "camera.toml").write_text(
        "".join(
            f"[{sensor}]\nwidth = 320\nheight = 240\nfx = 275\nfy = 275\ncx = 160\ncy = 120\n"
            for sensor in ("depth", "color")
        )
    )
    folder, out = data_set("sl_rgbd_deform_petit"), tmp_path / "toy.mcap"
    options = ["--camera", str(tmp_path / "camera.toml"), "--depth", "depth_mm_*.png", "--mask", "seg_*.png"]
    assert cli.main(["import", str(folder), "--layout", "pairs", "--out", str(out), *options]) == Exit.OK
    recording = Recording(out)
    assert recording.counts == {("depth", "depth"): 120, ("color", "color"): 120}
    depth = next(frame for frame in recording.frames() if isinstance(frame, Frame) and frame.sensor == "depth")
    assert depth.seq == 200
    assert 0.01 < np.isfinite(depth.si()).mean() < 0.5
    assert 0.3 < np.nanmedian(depth.si()) < 1.5
