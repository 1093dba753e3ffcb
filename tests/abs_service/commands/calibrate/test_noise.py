"""`abs-service calibrate noise`: from static recordings to a table that a rig file takes, with verdicts in words."""

import json
import math
import time
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from abs_service.calibration.noise import measurement, verdicts
from abs_service.calibration.shots import sequences
from abs_service.cli import main
from abs_service.config import plugins
from abs_service.report.content import Level, Verdict
from abs_service.supervision.exit_codes import Exit
from calib.no_return import NoReturn
from calib.noise.base import NoiseError
from calib.noise.per_pixel import PerPixel
from calib.noise.tof_amplitude import TofAmplitude
from calib.sequences.reference import Kind
from tests.calib.sequences.walls import frames

DISTANCES, MATERIALS = (0.7, 1.0, 1.3, 1.6, 1.9), (0.9, 0.5, 0.3)


def walls(query: str, n: int = 30) -> tuple[list[sequences.Sequence], list[float], Any]:
    """The paper's calibration (5.1): five distances, three materials."""
    found, depths, head = [], [], None
    for depth in DISTANCES:
        for number, reflectivity in enumerate(MATERIALS):
            seed = round(100 * depth) + number
            uri = f"simulated://wall?sensors=tof&distance={depth}&reflectivity={reflectivity}&seed={seed}&{query}"
            taken, head = frames(uri, 0, n)
            found += sequences.of_frames(f"{depth} m, {reflectivity}", taken, {"tof": head.camera}, "", n)
            depths.append(depth)
    return found, depths, head


def learnt(
    found: list[sequences.Sequence], depths: list[float], box: tuple[slice, slice] = (slice(None), slice(None))
) -> measurement.NoiseCalibration:
    region = np.zeros(found[0].lengths.shape[1:], bool)
    region[box] = True
    return measurement.calibrate(found, depths, region, np.random.default_rng(0), lambda text: None)


@pytest.mark.slow
def test_five_distances_and_three_materials_give_the_law_and_what_pixels_differ_by() -> None:
    found, depths, head = walls("tof=64x48&offset=0.02&dark=-8&wiggle=0.002&pattern=0.003&tilt=4")
    result = learnt(found, depths)
    model = result.model
    assert isinstance(model, PerPixel)
    assert isinstance(model.model, TofAmplitude)
    rows, columns = (part.ravel() for part in np.indices(head.pattern.shape))
    for depth in np.linspace(DISTANCES[0], DISTANCES[-1], 9):
        for reflectivity in np.linspace(MATERIALS[-1], MATERIALS[0], 5):
            x = np.full(rows.size, depth)
            a = 10_000 * reflectivity / x**2
            truth = head.noise.mu(x, a) + head.pattern.ravel()
            error = model.mean(x, a, (rows, columns)) - truth
            assert np.sqrt(np.mean(error**2)) < 1e-3
            assert np.abs(np.median(error)) < 1e-3
            assert np.abs(model.model.mean(x, a, (rows, columns))[0] - head.noise.mu(x, a)[0]) < 1e-3
            ratio = model.deviation(x, a, (rows, columns)) / head.noise.sigma(x, a)
            assert np.quantile(np.abs(ratio - 1), 0.99) < 0.10
    quality = result.chosen.quality
    assert quality.within_one == pytest.approx(0.683, abs=0.02)
    assert quality.within_95 == pytest.approx(0.95, abs=0.015)


@pytest.mark.slow
def test_where_pixels_do_not_differ_maps_of_them_are_not_used() -> None:
    result = learnt(*walls("tof=32x24")[:2])
    assert isinstance(result.model, TofAmplitude)
    assert result.by_sequence
    assert {trial.candidate.level for trial in result.trials} == {"image", "region", "pixel"}


@pytest.mark.slow
def test_one_sequence_before_anything_tells_the_scatter_in_time_and_no_more() -> None:
    taken, head = frames("simulated://sheet?sensors=structured_light&speed=0&structured_light=96x72", 0, 30)
    (one,) = sequences.of_frames("desk", taken, {"structured_light": head.camera}, "", 30)
    result = learnt([one], [math.nan], (slice(20, 52), slice(28, 68)))  # half of it the sheet, half the wall
    x = np.array([1.0, 1.6])
    expected = x**2 * np.sqrt(head.noise.random**2 + head.noise.step**2 / 12)
    measured = result.model.deviation(x, x, (np.zeros(2, int), np.zeros(2, int)))
    np.testing.assert_allclose(measured, expected, rtol=0.2)
    assert result.kind is Kind.MEAN
    assert not result.missing.targets
    assert not result.by_sequence


def test_exposure_settings_are_kept_apart_and_sequences_need_one_sensor() -> None:
    taken, head = frames("simulated://wall?sensors=tof&tof=32x24", 0, 20)
    short, long = ([replace(f, exposure_s=s) for f in taken[k::2]] for k, s in ((0, 1e-3), (0, 4e-3)))
    both = sequences.of_frames("x", [*short, *long], {"tof": head.camera}, "", 50)
    assert [one.exposure for one in both] == ["1 ms", "4 ms"]
    with pytest.raises(sequences.SequenceError, match="no depth image of a sensor 'left'"):
        sequences.of_frames("x", taken, {"tof": head.camera}, "left", 50)
    other = [replace(f, sensor="other") for f in taken]
    with pytest.raises(sequences.SequenceError, match="several depth sensors"):
        sequences.of_frames("x", [*taken, *other], {"tof": head.camera}, "", 500)
    wide, wider = frames("simulated://wall?sensors=tof&tof=64x48", 0, 9)
    second = sequences.of_frames("y", wide, {"tof": wider.camera}, "", 9)
    with pytest.raises(NoiseError, match="different sizes"):
        learnt([both[0], *second], [math.nan] * 2)


@pytest.mark.slow
def test_the_command_writes_a_table_for_the_rig_file_and_a_report(tmp_path: Path, capsys) -> None:
    wall = "simulated://wall?sensors=tof&tof=32x24&rate=200&reflectivity=0.14&pattern=0.006"
    sources = [f"{wall}&distance={d}" for d in (0.8, 1.2, 1.6)]  # the last is nearly too faint to return
    options = ["--frames", "12", "--out", str(tmp_path / "lab-1.2"), "--json"]
    code = main(["calibrate", "noise", *sources, *options, "--distance-m", "0.8", "1.2", "1.6"])
    said = json.loads(capsys.readouterr().out)
    assert code == said["exit_code"]
    assert said["values"]["reference"] == "known distance"
    assert said["values"]["fixed_pattern_m"] == pytest.approx(0.006, rel=0.15)
    assert {path.name for path in tmp_path.iterdir()} >= {"lab-1.2.toml", "lab-1.2.html", "lab-1.2.json"}
    tables = tomllib.loads((tmp_path / "lab-1.2.toml").read_text(encoding="utf-8"))["sensors"]["tof"]
    model = plugins.load("calib.noise", tables["noise"], tmp_path).build()
    assert isinstance(model, PerPixel)
    assert model.shape == (24, 32)
    law = plugins.settings("calib.no_return", tables["no_return"], tmp_path)
    assert law == NoReturn(**said["values"]["no_return"])
    assert law.probability(1.7, 0.95) > 2 * law.probability(0.8, 1.0)
    page = (tmp_path / "lab-1.2.html").read_text(encoding="utf-8")
    assert page.count("<figure>") >= 5
    assert "--distance-m 0.8 1.2 1.6" in page


def test_every_depth_image_that_is_read_is_counted(tmp_path: Path) -> None:
    source, counted = "simulated://wall?sensors=tof&tof=32x24&rate=200", []
    taken, head = frames(source, 0, 12)
    sequences.of_frames("x", taken, {"tof": head.camera}, "", 50, lambda: counted.append("file"))
    assert counted.count("file") == 12
    sequences.of_device(source, "", 5, time.monotonic_ns, lambda: counted.append("device"))
    assert counted.count("device") >= 5


@pytest.mark.slow
def test_a_folder_of_images_is_read_with_its_camera_and_so_is_a_recording(tmp_path: Path, capsys) -> None:
    taken, head = frames("simulated://wall?sensors=structured_light&structured_light=64x48&distance=1.1", 0, 12)
    for number, frame in enumerate(taken):
        cv2.imwrite(str(tmp_path / f"depth_{number:03}.png"), np.asarray(frame.data, np.uint16))
    camera = head.camera
    keys = f"fx = {camera.fx}\nfy = {camera.fy}\ncx = {camera.cx}\ncy = {camera.cy}\n"
    (tmp_path / "camera.toml").write_text(f"[depth]\nwidth = 64\nheight = 48\n{keys}")
    described = ["--camera", str(tmp_path / "camera.toml")]
    recording = tmp_path / "wall.mcap"
    assert main(["import", str(tmp_path), "--layout", "pairs", *described, "--out", str(recording)]) == Exit.OK
    (recorded,) = sequences.of_recording(recording, "", 8)
    np.testing.assert_allclose(recorded.lengths, [frame.si() for frame in taken[:8]])
    assert recorded.digit == pytest.approx(0.001)
    capsys.readouterr()
    options = [*described, "--out", str(tmp_path / "noise")]
    assert main(["calibrate", "noise", str(tmp_path), *options]) == 1
    said = capsys.readouterr().out
    assert "The mean offset is not determined" in said
    assert "Record at five distances" in said
    assert "too few to hold out a whole one" in said
    assert "doubtful: see noise.html" in (tmp_path / "noise.toml").read_text(encoding="utf-8")


def test_a_bad_model_is_reported_and_not_written(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(verdicts, "verdicts", lambda found: (Verdict(Level.BAD, "σ is none"),))
    source = "simulated://wall?sensors=tof&tof=32x24&rate=200"
    assert main(["calibrate", "noise", source, "--frames", "9", "--out", str(tmp_path / "x")]) == Exit.USER
    assert "σ is none" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {"x.html", "x.json"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--distance-m", "1", "2"], "2 distances for 1 sources"),
        (["--box", "500", "0", "600", "10"], "leave nothing of the image"),
        (["--mask", "nowhere.png"], "--mask = 'nowhere.png': cannot be read"),
        (["--frames", "5"], "5 frames are too few to tell noise from motion"),
        (["--sensor", "left"], "no depth image of a sensor 'left'"),
    ],
)
def test_what_cannot_be_done_is_said(options: list[str], message: str, capsys, tmp_path: Path) -> None:
    source = "simulated://wall?sensors=tof&tof=32x24&rate=200"
    given = ["--frames", "9"] if "--frames" not in options else []
    assert main(["calibrate", "noise", source, "--out", str(tmp_path / "x"), *given, *options]) == Exit.USER
    assert message in capsys.readouterr().err
