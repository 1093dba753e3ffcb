"""Commands whose caller has closed a standard file, gives it another encoding, or a disk that is full."""

import os
import subprocess
import sys

import pytest

from abs_service.supervision.exit_codes import Exit

CHECK = f"{sys.executable} -m abs_service check"


def shell(command, **environment):
    kept = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment
    done = subprocess.run(["sh", "-c", command], capture_output=True, env=kept, check=False)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_command_whose_standard_files_are_closed_works(closed):
    code, _, errors = shell(f"{CHECK} {closed}")
    assert (code, errors) == (Exit.OK, b"")


@pytest.mark.parametrize("closed", ["<&-", "<&- >&- 2>&-"])
def test_what_is_opened_later_is_no_standard_file(closed):
    program = (
        "import os\nfrom abs_service.supervision import standard_files\nstandard_files.secure()\n"
        "os._exit(os.open('/', os.O_RDONLY))"
    )
    code, _, _ = shell(f'{sys.executable} -c "{program}" {closed}')
    assert code > 2


def test_characters_that_an_encoding_has_not_are_replaced():
    code, output, errors = shell(CHECK, PYTHONIOENCODING="ascii")
    assert (code, errors) == (Exit.OK, b"")
    assert b"?" in output


def test_an_output_on_a_full_disk_is_one_line():
    code, _, errors = shell(f"{CHECK} > /dev/full")
    assert code == Exit.USER
    assert errors == b"abs-service: error: standard output cannot be written: No space left on device\n"
