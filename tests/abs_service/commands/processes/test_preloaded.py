"""The fork server has imported what the processes of a rig need: what is installed may change while a rig runs."""

import os
import subprocess
import sys

import pytest

PROGRAM = """
import time
from abs_service.supervision.children import forked
from abs_service.supervision.children.child_process import ChildProcess
from tests.abs_service.supervision.children import child_code

NEW = '''
import sys
before = set(sys.modules)
import abs_service.cli
code = abs_service.cli.main([%r, "--connect", "tcp/127.0.0.1:1"])
new = set(sys.modules) - before
print(code, *sorted(name for name in new if name.startswith(("abs_service.", "calib.", "drivers."))))
'''
forked.preload("abs_service.commands.processes.preloaded")
child = ChildProcess("child", [NEW % COMMAND], lambda *_: None, child_code.run)
while child.poll() is None:
    time.sleep(0.05)
print(child.output_tail().splitlines()[-1])
"""


@pytest.mark.slow
@pytest.mark.parametrize("command", ["capture", "record", "track"])
def test_a_process_that_starts_imports_nothing_of_ours(command):
    """Or a recorder that starts again after an upgrade would be of two versions, and fail again and again."""
    text = PROGRAM.replace("COMMAND", repr(command))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", text], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "3\n", done.stderr
