"""The parts of a rig as commands of their own, without `run`."""

import signal

import pytest

from tests.system.running import START_S, RigListener, wait_until

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


def test_capture_listens_track_and_record_connect_and_each_ends_in_order(rig_file, endpoint, launch, tmp_path):
    # Another endpoint in the file, so that only the options can have brought them together.
    rig_file.write_text(rig_file.read_text().replace(endpoint, "tcp/127.0.0.1:1"))
    capture = launch("capture", rig_file, "--listen", endpoint)
    with RigListener(endpoint) as listener:
        record = launch("record", rig_file, "--connect", endpoint)
        track = launch("track", rig_file, "sheet", "--connect", endpoint)
        wait_until(listener.tracks_since(0), START_S, "TRACKING")
        wait_until(lambda: any(h.gauges["file_bytes"] > 1e6 for h in listener.health("record")), 20, "a growing file")
        for process in (track, record, capture):
            process.send_signal(signal.SIGTERM)
            assert process.wait(5) == 0
            assert process.stderr.read() == ""
    (path,) = (tmp_path / "takes").iterdir()
    assert path.suffix == ".mcap"
