"""The client as others install it: a wheel of its own that needs the messages, zenoh and NumPy, and nothing else."""

import ast
import subprocess
import sys
import tomllib
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import abs_service

ROOT = Path(__file__).parents[2]
SERVICE = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
CLIENT = tomllib.loads((ROOT / "client" / "pyproject.toml").read_text("utf-8"))["project"]
EXTRAS = {Requirement(line).name for lines in CLIENT["optional-dependencies"].values() for line in lines}
NEEDED = sorted(Requirement(line).name for line in CLIENT["dependencies"])
IMPORTS = """
import sys
import abs_client, abs_client.pytest_plugin
heavy = {"abs_service", "calib", "cv2", "drivers", "llvmlite", "matplotlib", "numba", "pydantic", "rosbags", "scipy"}
print(sorted(heavy & set(sys.modules)), abs_client.__file__)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder), cwd=ROOT / "client")
    return next(folder.glob("*.whl"))


def test_the_wheel_holds_the_client_and_the_messages_of_the_service(wheel):
    archive = zipfile.ZipFile(wheel)
    names = set(archive.namelist())
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"abs_client", "absmsg"}
    assert {"abs_client/py.typed", "abs_client/web/page.html", "absmsg/py.typed"} <= names
    for path in (ROOT / "proto").rglob("*_pb2.py"):
        assert archive.read(str(path.relative_to(ROOT / "proto"))) == path.read_bytes()


def test_the_client_has_the_version_and_the_requirements_of_the_service(wheel):
    assert wheel.name.startswith(f"abs_service_client-{abs_service.__version__}-")
    assert NEEDED == ["eclipse-zenoh", "foxglove-schemas-protobuf", "numpy", "protobuf"]
    strip = {Requirement(line).name: Requirement(line).specifier for line in SERVICE["dependencies"]}
    assert {Requirement(line).specifier == strip[Requirement(line).name] for line in CLIENT["dependencies"]} == {True}


def test_what_the_client_imports_is_required():
    """But pytest, which is there when it loads the plugin."""
    nodes = [node for path in (ROOT / "client").rglob("*.py") for node in ast.walk(ast.parse(path.read_text("utf-8")))]
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    named = plain | {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    own = {"abs_client", "absmsg", "pytest", *sys.stdlib_module_names}
    needed = {"foxglove_schemas_protobuf", "google", "numpy", "zenoh"}
    assert {name.split(".")[0] for name in named} - own == needed | EXTRAS
    assert {"rosbags", "xxhash"} == EXTRAS


@pytest.mark.slow
def test_it_works_where_nothing_but_its_requirements_is_installed(wheel, tmp_path):
    environment = tmp_path / "venv"
    venv.create(environment)
    python = str(environment / "bin" / "python")
    _run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", str(wheel))
    site = next((environment / "lib").glob("python*/site-packages"))
    _link(site, [*NEEDED, "pytest", "pluggy", "iniconfig", "packaging", "pygments"])
    said = _run(python, "-I", "-c", IMPORTS, cwd=tmp_path)
    assert said == f"[] {site / 'abs_client' / '__init__.py'}\n"
    assert "--abs-rig=KEY=VALUE" in _run(python, "-I", "-m", "pytest", "--help", cwd=tmp_path)


def _link(site, distributions):
    """Makes installed distributions importable elsewhere, and no others."""
    for name in distributions:
        distribution = metadata.distribution(name)
        for top in {path.parts[0] for path in distribution.files or () if path.parts[0] not in ("..", "__pycache__")}:
            if not (site / top).exists():
                (site / top).symlink_to(Path(str(distribution.locate_file(top))))


def _run(*command, cwd=None):
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
