"""A run of the tests ends, whatever its tests leave behind."""

import os
import subprocess
import sys

CONFTEST = """
import tests.conftest

tests.conftest.EXIT_S = 1.0
pytest_unconfigure = tests.conftest.pytest_unconfigure
"""

TEST = """
import threading

from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus


def test_fails():
    bus = ZenohBus.open("demo", "ENDPOINT", SessionMode.ROUTER, shared_memory=False)
    bus.subscribe("config", lambda sample: threading.Event().wait())
    threading.Thread(target=threading.Event().wait).start()
    raise AssertionError
"""


def test_a_failing_test_whose_callback_is_blocked_ends_the_run_in_seconds(tmp_path, endpoint):
    (tmp_path / "conftest.py").write_text(CONFTEST, encoding="utf-8")
    (tmp_path / "test_fails.py").write_text(TEST.replace("ENDPOINT", endpoint), encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--rootdir", tmp_path, tmp_path],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert "1 failed" in ended.stdout, ended.stdout + ended.stderr
    assert "Timeout (0:00:01)" in ended.stderr
    assert ended.returncode == 1
