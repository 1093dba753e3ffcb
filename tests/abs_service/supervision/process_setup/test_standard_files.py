"""Commands whose caller has closed a standard file, gives it another encoding, or a disk that is full."""

import errno
import os
import subprocess
import sys

import pytest

from abs_service.supervision.exit_codes import Exit, lack_of_host
from abs_service.supervision.process_setup import standard_files

CHECK = f"{sys.executable} -m abs_service check"


def shell(command, **environment):
    kept = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)} | environment
    done = subprocess.run(["sh", "-c", command], capture_output=True, env=kept, check=False)
    return done.returncode, done.stdout, done.stderr


def thread_limit():
    return RuntimeError("can't start new thread")


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_command_whose_standard_files_are_closed_works(closed):
    code, _, errors = shell(f"{CHECK} {closed}")
    assert (code, errors) == (Exit.OK, b"")


@pytest.mark.parametrize("closed", ["<&-", "<&- >&- 2>&-"])
def test_what_is_opened_later_is_no_standard_file(closed):
    program = (
        "import os\nfrom abs_service.supervision.process_setup import standard_files\nstandard_files.secure()\n"
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


@pytest.mark.parametrize("error", [ConnectionError("nobody answers"), FileNotFoundError(2, "No such file", "rig.toml")])
def test_an_error_of_something_else_leaves_nothing_in_the_output(error, capsys):
    assert standard_files.blamed(error) is error
    assert capsys.readouterr().out == ""


def test_a_limit_of_memory_is_told():
    program = "from abs_service.supervision.exit_codes import lack_of_host as l; print(l(MemoryError()))"
    code, output, _ = shell(f'ulimit -v 500000; {sys.executable} -c "{program}"')
    assert (code, output) == (0, b"out of memory; memory is limited to 512 MB (ulimit -v)\n")


def test_too_few_open_files_are_refused_before_anything_is_opened():
    code, _, errors = shell(f"ulimit -n 32; {CHECK}")
    assert code == Exit.USER
    assert errors == b"abs-service: error: the limit of open files is 32, at least 64 are needed: ulimit -n 1024\n"


def test_a_working_directory_that_was_deleted_is_told(tmp_path):
    code, _, errors = shell(f"mkdir {tmp_path}/gone; cd {tmp_path}/gone; rmdir {tmp_path}/gone; {CHECK}")
    assert code == Exit.USER
    assert errors == b"abs-service: error: the working directory was deleted; change to another one\n"


def test_a_low_limit_of_open_files_is_raised_if_it_can_be():
    program = "import abs_service.supervision.process_setup.standard_files as s, resource as r; s.allow_files()"
    code, output, _ = shell(f'ulimit -S -n 32; {sys.executable} -c "{program}; print(r.getrlimit(r.RLIMIT_NOFILE)[0])"')
    assert (code, output) == (0, b"1024\n")


def test_a_rig_may_open_more_files_since_each_restart_of_a_process_costs_some():
    modules = "children.forked as f, abs_service.supervision.process_setup.standard_files as s"
    program = f"import abs_service.supervision.{modules}; s.allow_files(f.FILES)"
    shown = f"{program}; import resource as r; print(r.getrlimit(r.RLIMIT_NOFILE)[0])"
    code, output, _ = shell(f'ulimit -S -n 1024; ulimit -H -n 5000; {sys.executable} -c "{shown}"')
    assert (code, output) == (0, b"5000\n")


NO_ROOM = ImportError("libopenblas.so: failed to map segment from shared object")


@pytest.mark.parametrize(
    "error", [MemoryError(), OSError(errno.EMFILE, "Too many open files"), thread_limit(), NO_ROOM]
)
def test_what_a_host_lacks_is_no_mistake_of_ours(error):
    assert lack_of_host(error)
    assert not lack_of_host(KeyError("name"))
