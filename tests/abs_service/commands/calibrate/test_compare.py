"""`abs-service calibrate compare`: which cameras, what is printed, what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.calibration.files import corner_file, rig_file
from abs_service.calibration.shots.corner_extraction import BoardObservations
from abs_service.report.provenance import Provenance
from abs_service.supervision.exit_codes import Exit
from calib.board.views import CornerView
from calib.camera import Camera
from calib.lenses.fisheye import KannalaBrandt
from calib.lenses.lens import Lens

CAMERA = Camera(640, 480, 500.0, 501.0, 322.0, 238.0, Lens(np.array([-0.2, 0.03])))
OTHER = replace(CAMERA, lens=Lens(np.array([-0.2, 0.03, 0, 0, 0.2])))


def written(path: Path, **cameras: Camera) -> Path:
    sensors = {name: rig_file.SensorCalibration(camera) for name, camera in cameras.items()}
    rig_file.write(rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-25")), path)
    return path


@pytest.fixture
def compare(capsys):
    """Runs the command; gives the exit code and what was printed."""

    def compare(*arguments: object) -> tuple[int, str, str]:
        try:
            code = cli.main(["calibrate", "compare", *map(str, arguments)])
        except SystemExit as end:  # by argparse
            code = int(end.code or 0)
        return code, *capsys.readouterr()

    return compare


def test_a_map_and_the_largest_difference_are_printed(compare, tmp_path: Path):
    one, other = written(tmp_path / "one.toml", color=CAMERA), written(tmp_path / "other.toml", left=OTHER)
    pixels = np.array([[200.0, 140], [440, 140], [440, 340], [200, 340]])
    views = (CornerView("color", 0, 0.0, np.zeros((4, 3)), pixels, 0.1),)
    corner_file.write(BoardObservations(views, (), {}, {"color": (640, 480)}), tmp_path / "one.corners.npz")
    code, out, _ = compare(one, other, "--corners", tmp_path / "one.corners.npz")
    assert code == Exit.OK
    assert out.startswith("color and left: difference of the projections\n  where boards were seen: median 0.0")
    assert "elsewhere: median" in out
    assert len(out.splitlines()) == 3 + 1 + 6
    found = json.loads(compare(one, other, "--json")[1])["color"]
    assert found["image"]["largest_px"] == pytest.approx(np.nanmax(np.array(found["map_px"], float)), abs=1e-4)


def test_differences_are_said_beside_those_of_chance(compare, tmp_path: Path):
    covariance = rig_file.Covariance(("color.fx", "color.fy", "color.x"), np.diag([4.0, 4.0, 1e-6]))
    sensors = {"color": rig_file.SensorCalibration(CAMERA)}
    one = tmp_path / "one.toml"
    rig_file.write(rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-28"), covariance=covariance), one)
    for other, beyond in ((replace(CAMERA, fx=501.0, fy=502.0), False), (OTHER, True)):
        path = written(tmp_path / f"{beyond}.toml", color=other)
        image = json.loads(compare(one, path, "--json")[1])["color"]["image"]
        assert (image["largest_px"] > image["chance_px"]) == beyond
        assert (image["beyond"] > 0.05) == beyond
        assert " px there (95 %); more than by chance in " in compare(one, path)[1]


def test_chance_is_without_bounds_where_a_fisheye_may_have_no_light(compare, tmp_path: Path):
    """A circle of light within the image, whose radius is as uncertain as the lens."""
    camera = Camera(748, 480, 208.5, 208.5, 374, 240, KannalaBrandt(np.array([-0.038, 0.005, -0.007, 0.0014])))
    names = tuple(f"color.{name}" for name in ("fx", "fy", "k1", "k2", "k3", "k4"))
    covariance = rig_file.Covariance(names, np.diag(np.square([0.3, 0.3, 0.004, 0.01, 0.01, 0.004])))
    one = tmp_path / "one.toml"
    sensors = {"color": rig_file.SensorCalibration(camera)}
    rig_file.write(rig_file.RigCalibration("lab", sensors, Provenance("x", "2026-11-28"), covariance=covariance), one)
    other = written(tmp_path / "other.toml", color=replace(camera, fx=208.0))
    code, out, err = compare(one, other)
    assert (code, err) == (Exit.OK, "")
    assert "nan" not in out


def test_cameras_are_matched_by_name_or_as_told(compare, tmp_path: Path):
    one = written(tmp_path / "one.toml", a=CAMERA, b=CAMERA)
    same, none = (
        written(tmp_path / "same.toml", b=CAMERA, c=CAMERA),
        written(tmp_path / "none.toml", x=CAMERA, y=CAMERA),
    )
    assert list(json.loads(compare(one, same, "--json")[1])) == ["b"]
    assert list(json.loads(compare(one, none, "--json", "--pair", "a=y")[1])) == ["a"]
    code, _, err = compare(one, none)
    assert (code, "no camera has the same name in both: a, b and x, y" in err) == (Exit.USER, True)


def test_a_format_that_is_unknown_is_named_by_an_option_that_there_is(compare, tmp_path: Path):
    (tmp_path / "x.cal").write_text("?")
    code, _, err = compare(written(tmp_path / "one.toml", b=CAMERA), tmp_path / "x.cal")
    assert (code, "`calibrate convert --from` takes toml" in err) == (Exit.USER, True), err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--pair", "z=b"), "--pair z=b"),
        (("--distance", "0"), "--distance: '0' must be a number above 0"),
        (("--corners", "none.corners.npz"), "none.corners.npz: cannot be read"),
        (("--size", "640"), "--size: '640' must be width and height"),
    ],
)
def test_options_that_do_not_fit_are_named(compare, tmp_path: Path, options: tuple[str, ...], said: str):
    one = written(tmp_path / "one.toml", b=CAMERA)
    code, _, err = compare(one, one, *options)
    assert (code, said in err) == (Exit.USER, True), err
