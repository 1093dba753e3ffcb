"""A recording as a source of messages, at the time that is asked for."""

import numpy as np
import pytest
from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.deformed_mesh_pb2 import DeformedMesh

from abs_service.display.page.feed import Feed
from abs_service.display.page.playback import Playback
from drivers.encoding import codec
from drivers.encoding.encoded_image import ImageCodec, encoder
from drivers.encoding.mcap_file import McapFile
from drivers.replay.contents import RecordingError
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    SIMULATION,
    STATUSES,
    vertices,
    write_estimated,
)

PERIOD_S = (SIMULATION.time_ns(1) - SIMULATION.time_ns(0)) * 1e-9


class Bench:
    """A page of a recording, whose clock the test moves."""

    def __init__(self, path):
        self.now_ns = 10**12
        self.playback = Playback(path, lambda: self.now_ns)
        self.feed = Feed(self.playback, self.playback.now_ns)
        self.feed.watch(True)

    def after(self, seconds: float) -> str:
        """The status that the page has so much later; "" without one."""
        self.now_ns += round(seconds * 1e9)
        self.playback.advance()
        found = self.feed.newest("sheet/state", DeformationState)
        return DeformationState.Status.Name(found[0].status).removeprefix("STATUS_") if found else ""


@pytest.fixture(params=[True, False], ids=["finished", "unfinished"])
def bench(tmp_path, request):
    return Bench(write_estimated(tmp_path / "x.mcap", finish=request.param))


def test_time_goes_on_as_it_was_recorded_and_ends_at_the_last_message(bench):
    bench.playback.jump(PERIOD_S / 2)
    bench.playback.play()
    assert [bench.after(0.0), *(bench.after(PERIOD_S) for _ in range(5))] == list(STATUSES)
    assert not bench.playback.playing
    assert bench.playback.position_s == pytest.approx(bench.playback.duration_s)
    bench.playback.play()
    bench.after(0.0)
    assert bench.playback.position_s == pytest.approx(0.0)


def test_twice_as_fast_passes_twice_as_much(bench):
    bench.playback.speed = 2.0
    bench.after(0.0)
    before_s = bench.playback.position_s
    bench.after(PERIOD_S)
    assert bench.playback.position_s - before_s == pytest.approx(2 * PERIOD_S)


def test_steps_go_from_estimate_to_estimate_and_pause(bench):
    seen = [bench.after(0.0)]
    for _ in range(6):
        bench.playback.step(forward=True)
        seen.append(bench.after(1.0))
    assert seen == [*STATUSES, STATUSES[-1]]
    assert not bench.playback.playing
    for status in (*STATUSES[-2::-1], STATUSES[0]):
        bench.playback.step(forward=False)
        assert bench.after(1.0) == status


def test_at_every_time_there_is_all_that_belongs_to_it(bench):
    bench.playback.playing = False
    for k in (3, 2, 4, 1):
        bench.playback.jump(k * PERIOD_S + 0.001)
        assert bench.after(0.0) == STATUSES[k]
        mesh, age_s = bench.feed.newest("sheet/mesh", DeformedMesh)
        assert age_s == pytest.approx(0.001, abs=1e-4)
        np.testing.assert_array_equal(np.frombuffer(mesh.vertices_f32, "<f4"), vertices(k).ravel())
        topology = bench.feed.topology(mesh)
        assert topology.faces_u32 == FACES[mesh.mesh_version].tobytes()
        assert sorted(bench.feed.cameras()) == ["color", "tof"]
        for topic in ("tof/depth/image", "color/color/image"):
            frame, _ = bench.feed.frame(topic, mesh.header.t_host_ns)
            assert frame.t_host_ns == SIMULATION.time_ns(k)


def test_in_a_pause_nothing_ages_and_without_a_browser_time_stands_still(bench):
    bench.playback.step(forward=True)
    bench.after(0.0)
    before = bench.playback.position_s, bench.feed.age_s()
    bench.after(100.0)
    assert (bench.playback.position_s, bench.feed.age_s()) == before
    bench.playback.play()
    bench.feed.watch(False)
    bench.after(PERIOD_S)
    assert bench.playback.position_s == before[0]
    assert bench.feed.streams() == []
    bench.feed.watch(True)  # a browser that comes later sees the same at once
    bench.after(PERIOD_S)
    assert bench.playback.position_s == before[0]
    assert "tof/depth/image" in bench.feed.streams()


def test_compressed_images_are_shown_too(tmp_path):
    bench = Bench(write_estimated(tmp_path / "x.mcap", encoder(ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)))
    bench.after(0.0)
    found = bench.feed.frame("tof/depth/image")
    assert found is not None
    exposed = next(one for one in SIMULATION.frames(0) if (one.sensor, one.stream) == ("tof", "depth"))
    np.testing.assert_array_equal(found[0].data, exposed.data)


def test_messages_that_are_none_of_ours_are_left_out_and_counted(tmp_path):
    state = DeformationState(tracker="sheet").SerializeToString()
    with (tmp_path / "x.mcap").open("wb") as stream:
        file = McapFile(stream)
        for seq, payload in enumerate((state, DeformationState(tracker="cloth").SerializeToString(), b"\xff", state)):
            file.write("/sheet/state", DeformationState.DESCRIPTOR.full_name, payload, 10**9 + seq, seq)
        file.write("/tof/depth/image", codec.IMAGE_SCHEMA, b"\xff", 10**9, 0)
        file.write("/tof/depth/info", codec.INFO_SCHEMA, b"\xff", 10**9, 0)
        file.finish()
    bench = Bench(tmp_path / "x.mcap")
    bench.playback.jump(1.0)
    assert bench.after(0.0) == "UNSPECIFIED"
    assert bench.playback.malformed == 3
    assert len(bench.feed.numbers("sheet")) == 2


def test_a_file_that_is_no_recording_is_refused(tmp_path):
    with pytest.raises(RecordingError):
        Playback(tmp_path / "none.mcap", lambda: 0)
