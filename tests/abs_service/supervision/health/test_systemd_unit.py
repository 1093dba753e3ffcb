"""The systemd unit of a rig, as systemd itself judges it."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

UNIT = Path(__file__).parents[4] / "docker" / "abs-service@.service"


class TestTheUnit:
    @pytest.fixture(autouse=True)
    def analyze(self):
        if shutil.which("systemd-analyze") is None:
            pytest.skip("no systemd-analyze: it is in the package systemd")

    def run(self, *arguments):
        return subprocess.run(["systemd-analyze", *arguments], capture_output=True, text=True, timeout=60, check=False)

    def test_its_exposure_is_at_most_two_and_a_half(self):
        found = self.run("security", "--offline=true", "--no-pager", str(UNIT))
        score = re.search(r"Overall exposure level for \S+: ([\d.]+)", found.stdout)
        assert score, found.stderr
        assert float(score[1]) <= 2.5

    def test_systemd_understands_every_line(self, tmp_path):
        program = tmp_path / "abs-service"
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
        copy = tmp_path / "abs-service@lab.service"
        copy.write_text(UNIT.read_text().replace("/opt/abs-service/bin/abs-service", str(program)))
        found = self.run("verify", "--man=no", str(copy))
        assert (found.returncode, [line for line in found.stderr.splitlines() if "abs-service" in line]) == (0, [])
