"""Kernels are kept in a temporary folder where no other can be written."""

import errno
import os
import tempfile

import pytest

import abs_service
from abs_service.supervision.process_setup import kernel_cache, standard_files
from calib import jit


@pytest.fixture
def given(monkeypatch, tmp_path):
    """Sets Numba's folder; only what is in `tmp_path` can be written."""
    monkeypatch.setattr(os, "access", lambda path, mode: str(path).startswith(str(tmp_path)))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(abs_service, "__file__", "/usr/lib/abs_service/__init__.py")

    def given(cache, user="/nonexistent"):
        monkeypatch.setenv(kernel_cache.USER, str(user))
        monkeypatch.setenv(kernel_cache.VARIABLE, str(cache))
        kernel_cache.ensure()
        return os.environ[kernel_cache.VARIABLE]

    return given


@pytest.mark.parametrize("cache", ["", "/nonexistent/numba", "/dev/null/numba"])
def test_a_temporary_folder_replaces_one_that_cannot_be_written(given, tmp_path, cache):
    assert given(cache).startswith(f"{tmp_path}/abs-service-kernels-")


def test_a_folder_that_can_be_written_is_kept(given, tmp_path):
    assert given(tmp_path / "not" / "yet") == str(tmp_path / "not" / "yet")
    assert given("", user=tmp_path) == ""


@pytest.mark.parametrize("user", ["", "in/the/working/directory", "/dev/null"])
def test_folders_beside_the_code_that_another_user_has_made_are_replaced(given, tmp_path, monkeypatch, user):
    monkeypatch.setenv("HOME", "/nonexistent")
    code = tmp_path / "installed" / "abs_service"
    others = tmp_path / "installed" / "calib" / "noise" / "__pycache__"
    for folder in (code, others):
        folder.mkdir(parents=True)
    monkeypatch.setattr(abs_service, "__file__", str(code / "__init__.py"))
    assert given("", user) == ""
    monkeypatch.setattr(os, "access", lambda path, mode: str(path).startswith(str(tmp_path)) and path != str(others))
    assert given("", user).startswith(f"{tmp_path}/abs-service-kernels-")
    assert os.environ.get(kernel_cache.USER, "/").startswith("/")


def test_a_full_temporary_folder_is_replaced_by_one_in_memory(given, monkeypatch):
    room = ["/dev/shm"]

    def full(**where):
        if where["dir"] not in room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return f"{where['dir']}/{where['prefix']}x"

    monkeypatch.setattr(tempfile, "mkdtemp", full)
    assert given("/nonexistent") == "/dev/shm/abs-service-kernels-x"
    monkeypatch.setattr(tempfile, "gettempdir", lambda: os.stat("/nowhere/at/all"))
    assert given("/nonexistent") == "/dev/shm/abs-service-kernels-x"
    room.clear()
    with pytest.raises(standard_files.StartError, match="make room, or set TMPDIR"):
        given("/nonexistent")


def test_a_full_disk_is_replaced(given, tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_cache, "MIN_BYTES", 1 << 62)
    assert given(tmp_path) != str(tmp_path)


@pytest.mark.parametrize("threads", ["", "0", "-1", "abc", "2.0", "100000"])
def test_a_number_of_threads_that_is_none_ends_a_command(monkeypatch, threads):
    monkeypatch.setenv(jit.THREADS, threads)
    with pytest.raises(standard_files.StartError, match=f'NUMBA_NUM_THREADS is "{threads}"; allowed: 1 to 1000'):
        kernel_cache.check_threads()
