"""The files of the image agree with each other and with the repository; Docker itself is needed by .ci/run only."""

import fnmatch
import re
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
DOCKER = ROOT / "docker"
DOCKERFILE = (DOCKER / "Dockerfile").read_text(encoding="utf-8")


def copied():
    """Sources of the Dockerfile, and of the steps it takes, that come from the repository."""
    lines = re.findall(r"^COPY (?!--from)(.+) \S+$", DOCKERFILE, re.M)
    return [source for line in lines for source in line.split()]


def test_what_the_image_copies_exists_and_reaches_docker():
    kept = [line[1:] for line in (DOCKER / "Dockerfile.dockerignore").read_text().splitlines() if line[:1] == "!"]
    assert [path for path in kept if not (ROOT / path).exists()] == []
    sources = [source for source in copied() if source != "."]
    assert sources
    assert [source for source in sources if not any(fnmatch.fnmatch(source, path) for path in kept)] == []


def test_the_chroot_takes_every_step_of_the_image():
    steps = set(re.findall(r"steps\.sh ((?:[a-z]+ ?)+)$", DOCKERFILE, re.M))
    names = {name for line in steps for name in line.split()}
    assert names == set(re.findall(r"^    ([a-z]+)\)$", (DOCKER / "steps.sh").read_text(), re.M))
    chroot = (DOCKER / "chroot.sh").read_text()
    assert [name for name in names if not re.search(rf"steps\.sh .*\b{name}\b", chroot)] == []


def test_an_unknown_step_is_refused():
    found = subprocess.run([DOCKER / "steps.sh", "everything"], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr.count('no step "everything"')) == (2, 1)


@pytest.mark.parametrize("name", ["compose.yaml", "compose.cameras.yaml"])
def test_the_services_are_those_of_the_image(name):
    services = yaml.safe_load((DOCKER / name).read_text())["services"]
    assert set(services) == {"abs-service", "subscriber"}
    files = [part for service in services.values() for part in service.get("entrypoint", []) if "/opt/" in part]
    assert all(Path(path).name in DOCKERFILE for path in files)
