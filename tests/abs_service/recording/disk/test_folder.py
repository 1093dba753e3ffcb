import errno
import os
import threading

import pytest

from abs_service.recording.disk import folder
from abs_service.recording.disk.folder import FolderError


def test_a_folder_is_made_and_left_empty(tmp_path):
    folder.check(tmp_path / "a" / "b")
    assert not list((tmp_path / "a" / "b").iterdir())


def test_a_mistake_is_explained(tmp_path):
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(FolderError, match='taken/below": cannot be made: Not a directory'):
        folder.check(tmp_path / "taken" / "below")


def test_a_folder_of_others_is_a_mistake(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: path != tmp_path)  # root may write all
    with pytest.raises(FolderError, match=f'"{tmp_path}": cannot be written: Permission denied'):
        folder.check(tmp_path)


def test_a_folder_that_is_there_is_not_written(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(os, "mkdir", lambda *arguments: written.append(arguments))
    monkeypatch.setattr(os, "open", lambda *arguments, **_: written.append(arguments))
    folder.check(tmp_path)
    assert not written


def test_a_link_to_a_disk_that_is_not_there_is_said_and_no_mistake(tmp_path):
    link, disk = tmp_path / "link", tmp_path / "disk"
    link.symlink_to(disk)
    for directory in (link, link / "below"):
        with pytest.raises(OSError, match=f"{link} is a link to {disk}, where nothing is"):
            folder.make(directory)
        folder.check(directory)
    assert not disk.exists()
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(FolderError, match=f'taken": cannot be made: {tmp_path}/taken is no folder'):
        folder.check(tmp_path / "taken")


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC, errno.EIO])
def test_a_disk_that_has_a_problem_does_not_keep_a_rig_from_tracking(number, tmp_path, monkeypatch):
    tried = []

    def refuse(directory):
        tried.append(directory)
        raise OSError(number, "of the disk")

    monkeypatch.setattr(os, "statvfs", refuse)
    folder.check(tmp_path)
    assert tried == [tmp_path]


def test_a_disk_that_does_not_answer_does_not_keep_a_rig_from_tracking(tmp_path, monkeypatch):
    answers = threading.Event()
    monkeypatch.setattr(folder, "PATIENCE_S", 0.01)
    tell = os.statvfs
    monkeypatch.setattr(os, "statvfs", lambda path: answers.wait() and tell(path))
    folder.check(tmp_path)
    assert not answers.is_set()
    answers.set()
