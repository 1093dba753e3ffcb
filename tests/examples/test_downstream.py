"""The example of a repository that uses abs-service: its tests pass as they are, and its workflow runs them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

FOLDER = Path(__file__).parents[2] / "examples" / "downstream"


@pytest.mark.slow
def test_its_tests_pass_against_simulated_rigs(tmp_path):
    copy = shutil.copytree(FOLDER, tmp_path / "downstream")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "abs_client.pytest_plugin", "-p", "no:cacheprovider"],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout


def test_its_workflow_installs_the_client_and_runs_the_tests():
    workflow = yaml.safe_load((FOLDER / ".github" / "workflows" / "test.yml").read_text("utf-8"))
    commands = [step["run"] for step in workflow["jobs"]["test"]["steps"] if "run" in step]
    assert "#subdirectory=client" in commands[0]
    assert commands[-1] == "pytest"
