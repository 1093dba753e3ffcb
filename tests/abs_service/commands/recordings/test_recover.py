"""`abs-service recover`: where the results go, and what it says."""

import argparse
import stat

from abs_service.commands.recordings import recover as command
from tests.abs_service.recording.test_recovery import FRAMES, read, write


def test_results_go_to_another_folder_and_the_originals_stay(tmp_path, capsys):
    source = write(tmp_path / "a.mcap.active", finish=False)
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([str(source), "--out", str(tmp_path / "saved" / "here")])) == 0
    assert source.exists()
    target = tmp_path / "saved" / "here" / "a.mcap"
    assert len(read(target)[0]) == 2 * FRAMES
    assert stat.filemode(target.stat().st_mode) == "-rw-r-----"
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["a.mcap.active"]


def test_the_command_reports_each_file_and_continues_after_an_error(tmp_path, capsys):
    source = write(tmp_path / "a.mcap.active", finish=False)
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([str(tmp_path / "none"), str(source)])) == 2
    output = capsys.readouterr()
    assert "No such file" in output.err
    assert "80 messages" in output.out


def test_a_file_of_which_nothing_can_be_saved_is_no_success(tmp_path, capsys):
    source, lost = write(tmp_path / "a.mcap.active", finish=False), tmp_path / "b.mcap.active"
    lost.write_bytes(source.read_bytes()[:100])
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([str(lost), str(source)])) == 1
    assert "b.mcap: 0 messages in 0 chunks saved" in capsys.readouterr().out


def test_nothing_that_is_there_is_overwritten(tmp_path, capsys):
    saved, parser = tmp_path / "saved", argparse.ArgumentParser()
    command.add_arguments(parser)
    for rig in ("one", "two"):
        (tmp_path / rig).mkdir()
        write(tmp_path / rig / "a.mcap")
    whole = (tmp_path / "two" / "a.mcap").read_bytes()
    (tmp_path / "two" / "a.mcap").write_bytes(whole[: len(whole) // 2])
    names = [str(tmp_path / rig / "a.mcap") for rig in ("one", "two")]
    assert command.run(parser.parse_args([*names, "--out", str(saved)])) == 2
    assert f"{names[1]}: {saved}/a.recovered.mcap is there already" in capsys.readouterr().err
    assert len(read(saved / "a.recovered.mcap")[0]) == 2 * FRAMES
    unfinished = write(tmp_path / "one" / "a.mcap.active", finish=False)
    unfinished.write_bytes(unfinished.read_bytes()[:-9000])
    assert command.run(parser.parse_args([str(unfinished)])) == 2
    assert unfinished.exists()
    assert (tmp_path / "one" / "a.mcap").read_bytes() == whole


def test_the_command_names_what_a_full_disk_does_not_take(tmp_path, capsys):
    source, saved = write(tmp_path / "a.mcap"), tmp_path / "saved"
    saved.mkdir()
    (saved / "a.recovered.mcap.recovering").symlink_to("/dev/full")
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([str(source), "--out", str(saved)])) == 2
    assert f"error: {saved}: cannot be written: No space left on device" in capsys.readouterr().err
    assert not list(saved.iterdir())


def test_a_file_where_the_folder_should_be_is_named(tmp_path, capsys):
    (tmp_path / "saved").write_text("mine")
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    assert command.run(parser.parse_args([str(write(tmp_path / "a.mcap")), "--out", str(tmp_path / "saved")])) == 2
    assert f"{tmp_path}/saved is no folder\n" in capsys.readouterr().err
