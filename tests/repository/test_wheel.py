"""The package as others install it: in an environment of its own, away from the checkout."""

import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

import abs_service

ROOT = Path(__file__).parents[2]
PACKAGES = {"abs_service", "drivers", "calib", "absmsg"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder), cwd=ROOT)
    return next(folder.glob("*.whl"))


def test_wheel_holds_the_four_packages_typed_and_nothing_else(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == PACKAGES
    assert {f"{package}/py.typed" for package in PACKAGES} <= set(names)


DATA_FILES = [
    (ROOT / "proto", "absmsg/v1/*.proto"),
    (ROOT, "abs_service/config/*.toml"),
    (ROOT, "drivers/orbbec/*.xml"),
]


@pytest.mark.parametrize(("folder", "pattern"), DATA_FILES)
def test_wheel_holds_the_data_files(wheel: Path, folder: Path, pattern: str) -> None:
    wanted = {str(path.relative_to(folder)) for path in folder.glob(pattern)}
    assert wanted
    assert wanted <= set(zipfile.ZipFile(wheel).namelist())


@pytest.mark.slow
def test_wheel_runs_away_from_the_checkout(wheel: Path, tmp_path: Path) -> None:
    environment = tmp_path / "venv"
    venv.create(environment)
    python = environment / "bin" / "python"
    _run(sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", str(wheel))
    # The requirements are those of this environment. Its .pth files do not count there, so neither does the checkout.
    site = next((environment / "lib").glob("python*/site-packages"))
    (site / "requirements.pth").write_text(sysconfig.get_path("purelib"))
    assert (
        _run(str(environment / "bin" / "abs-service"), "--version", cwd=tmp_path)
        == f"abs-service {abs_service.__version__}\n"
    )
    origin = _run(
        str(python),
        "-c",
        "import abs_service as s, drivers as d, calib as c, absmsg.v1 as a; print(s, d, c, a)",
        cwd=tmp_path,
    )
    assert origin.count(str(site)) == len(PACKAGES)
    rig = _run(str(python), "-c", "from abs_service import config; print(config.load_default().name)", cwd=tmp_path)
    assert rig == "demo\n"


def _run(*command: str, cwd: Path | None = None) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
