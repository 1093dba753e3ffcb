"""`abs-service replay`: the same estimates each time, in a file that others can read, and clear words otherwise."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from abs_service import cli, config
from abs_service.supervision.exit_codes import Exit
from abs_service.tracking.replay import free_path
from drivers.contract.frame import Frame
from drivers.encoding import encoded_image
from drivers.encoding.encoded_image import ImageCodec
from drivers.replay.recording import Recording
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import WALL_NS, write_take

COUNT = 20
SIMULATION = parse("simulated://sheet?seed=1").build()
#: Another number than the default, which the replay must not take.
TOML = config.to_toml(config.load_default()).replace("\nsteps = 12\n", "\nsteps = 2\n")
FIRST = 30  # the sheet begins to move


def write(path: Path, *, toml: str = TOML, finish: bool = True, sensors: tuple[str, ...] = ("tof", "color")) -> Path:
    return write_take(path, SIMULATION, range(FIRST, FIRST + COUNT), {name: name for name in sensors}, toml, finish)


def decoded(path: Path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return list(reader.iter_decoded_messages()), {a.name: a.data for a in reader.iter_attachments()}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("recordings") / "x.mcap")


@pytest.fixture(scope="module")
def replayed(recording: Path) -> list[Path]:
    """Replayed twice, without saying where to."""
    for _ in range(2):
        assert cli.main(["replay", str(recording)]) == Exit.OK
    return [recording.with_name("x_replay.mcap"), recording.with_name("x_replay_2.mcap")]


def thetas(path: Path) -> list[bytes]:
    return [np.array(m.theta).tobytes() for _, channel, _, m in decoded(path)[0] if channel.topic == "/sheet/state"]


def test_the_estimates_are_the_same_to_the_last_bit(replayed):
    first, second = map(thetas, replayed)
    assert len(first) == COUNT
    assert first == second
    assert len(set(first)) > 10  # it does not only repeat itself


def test_images_without_loss_give_the_same_estimates_to_the_last_bit(recording, replayed, tmp_path):
    encode = encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)
    names = {"tof": "tof", "color": "color"}
    path = tmp_path / "small.mcap"
    write_take(path, SIMULATION, range(FIRST, FIRST + COUNT), names, TOML, encode_image=encode)
    for raw, small in zip(Recording(recording).frames(), Recording(path).frames(), strict=True):
        if isinstance(raw, Frame):
            assert isinstance(small, Frame)
            assert raw.data.tobytes() == small.data.tobytes()
            assert raw.encoding == small.encoding
    assert cli.main(["replay", str(path)]) == Exit.OK
    assert thetas(path.with_name("small_replay.mcap")) == thetas(replayed[0])


def test_every_topic_can_be_decoded_by_its_schema(replayed):
    messages, attachments = decoded(replayed[0])
    topics: dict[str, list] = {}
    for schema, channel, message, content in messages:
        assert schema is not None
        assert schema.encoding == "protobuf"
        assert content.DESCRIPTOR.full_name == schema.name
        topics.setdefault(channel.topic, []).append((schema.name, message, content))
    assert {topic: (entries[0][0], len(entries)) for topic, entries in topics.items()} == {
        "/sheet/state": ("absmsg.v1.DeformationState", COUNT),
        "/sheet/mesh": ("absmsg.v1.DeformedMesh", COUNT),
        "/sheet/topology": ("absmsg.v1.MeshTopology", 1),
    }
    replayed_with = config.loads(attachments["rig.toml"].decode(), "rig.toml", Path("/"))
    assert replayed_with.trackers["sheet"].optimizer.steps == 2
    check_times(topics)
    check_mesh(topics)


def check_times(topics):
    """Everything carries the time of the exposure, as if it had been recorded then."""
    for k, (_, message, state) in enumerate(topics["/sheet/state"]):
        t_ns = SIMULATION.time_ns(FIRST + k)
        assert (message.log_time, message.sequence) == (WALL_NS + t_ns, k)
        assert (state.header.t_host_ns, state.header.stamp.ToNanoseconds()) == (t_ns, WALL_NS + t_ns)
        assert state.header.frame_id == "rig"
        assert (state.tracker, state.model, state.mesh_version) == ("sheet", "nurbs", 1)


def check_mesh(topics):
    topology, state = topics["/sheet/topology"][0][2], topics["/sheet/state"][0][2]
    rest = np.frombuffer(topology.rest_vertices_f32, "<f4").reshape(-1, 3)
    faces = np.frombuffer(topology.faces_u32, "<u4")
    assert faces.max() == len(rest) - 1
    assert len(topology.colors_u8) == rest.size
    assert topology.header.t_host_ns == SIMULATION.time_ns(FIRST)
    for _, _, mesh in topics["/sheet/mesh"]:
        assert len(mesh.vertices_f32) == len(topology.rest_vertices_f32)
    assert len(state.model_id) == len(state.calib_id) == 16
    assert {sensor.sensor for sensor in state.sensors} == {"tof", "color"}


def test_with_its_images_a_replay_is_a_recording_that_replays_to_the_same(recording, replayed, tmp_path):
    rig, out, again = tmp_path / "rig.toml", tmp_path / "out.mcap", tmp_path / "again.mcap"
    table = "[sensors.color.camera]\n"
    rig.write_text(TOML.replace(table, f"{table}T_rs = {{ translation = [0.06, 0.0, 0.0] }}\n"))
    assert cli.main(["replay", str(recording), "--config", str(rig), "--images", "--out", str(out)]) == Exit.OK
    source, copy = Recording(recording), Recording(out)
    assert copy.counts == source.counts
    assert copy.cameras["tof"].calib_id == source.cameras["tof"].calib_id
    assert copy.cameras["color"].center.tolist() == [0.06, 0.0, 0.0]  # that of the replay
    assert cli.main(["replay", str(out), "--out", str(again)]) == Exit.OK
    assert thetas(again) == thetas(out) != thetas(replayed[0])


def test_a_live_replay_has_its_images_recorded_by_run_and_a_speed_that_can_be(recording, capsys):
    assert cli.main(["replay", str(recording), "--images", "--speed", "1"]) == Exit.USER
    assert "--out FOLDER records the images" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        cli.main(["replay", str(recording), "--speed", "nan"])
    assert "argument --speed: 'nan' must be a number from 0.01 to 100" in capsys.readouterr().err


def test_one_json_object_per_estimate(recording, tmp_path, capsys):
    assert cli.main(["replay", str(recording), "--json", "--out", str(tmp_path / "out.mcap")]) == Exit.OK
    captured = capsys.readouterr()
    lines = [json.loads(line) for line in captured.out.splitlines()]
    assert len(lines) == COUNT
    wanted = ["seq", "stamp", "status", "reasons", "theta", "error_mm", "surface_mm", "solve_ms", "age_ms"]
    for k, line in enumerate(lines):
        assert set(line) >= {*wanted, "generations", "evaluations"}
        assert (line["tracker"], line["seq"], line["status"], line["reasons"]) == ("sheet", k, "TRACKING", [])
        assert line["stamp"].startswith("2023-11-14T22:13:2")
        assert len(line["theta"]) == 60
        assert 0 < line["surface_mm"] <= line["error_mm"] < 3
        assert line["error_mm"] / 2 < line["vertex_sigma_mm"] < 4
        assert line["solve_ms"] > 0
        assert line["age_ms"] is None  # offline there is no such thing
        assert line["generations"] <= 2
        assert line["evaluations"] >= 1
    assert "20 estimates" in captured.err
    assert "vertex error mean" in captured.err


def test_a_replay_that_tracks_nothing_fails_and_tells_the_last_reason_in_the_summary(recording, tmp_path, capsys):
    rig = tmp_path / "rig.toml"
    rig.write_text(TOML.replace("minimum_pixels = 200", "minimum_pixels = 1000000"))
    code = cli.main(["replay", str(recording), "--config", str(rig), "--out", str(tmp_path / "out.mcap")])
    assert code == Exit.FAILED
    summary = capsys.readouterr().out
    assert "sheet: nothing was tracked\n" in summary
    assert "20 INITIALIZING\n" in summary
    assert "sheet: INITIALIZING at the end: no connected surface of at least minimum_pixels" in summary


def test_amplitudes_that_a_tracker_does_not_ask_for_are_not_reported_as_lost(recording, tmp_path, capsys):
    rig = tmp_path / "rig.toml"
    rig.write_text(re.sub(r'type = "gaussian_polynomial"(?s:.*?)\n\n', 'type = "constant"\nsigma = 0.005\n\n', TOML))
    assert cli.main(["replay", str(recording), "--config", str(rig), "--out", str(tmp_path / "out.mcap")]) == Exit.OK
    assert "frames in no set" not in capsys.readouterr().out


def test_a_reference_that_is_not_in_the_recording_is_named(recording, tmp_path, capsys):
    rig = tmp_path / "rig.toml"
    rig.write_text(TOML.replace('"tof/depth"', '"tof/dept"'))
    assert cli.main(["replay", str(recording), "--config", str(rig)]) == Exit.USER
    message = 'tracker "sheet" is paced by tof/dept, which is not there; did you mean "tof/depth"? allowed: color/color'
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(("name", "said"), [("out.mcap", "exists already"), ("out.mcap.active", "is there")])
def test_what_exists_is_not_overwritten(recording, tmp_path, capsys, name, said):
    (tmp_path / name).write_bytes(b"precious")
    assert cli.main(["replay", str(recording), "--out", str(tmp_path / "out.mcap")]) == Exit.USER
    assert f"{tmp_path}/{name}" in (error := capsys.readouterr().err)
    assert said in error
    assert (tmp_path / name).read_bytes() == b"precious"


def test_a_folder_that_is_not_there_is_named(recording, tmp_path, capsys):
    assert cli.main(["replay", str(recording), "--out", str(tmp_path / "none" / "out.mcap")]) == Exit.USER
    assert f"--out {tmp_path}/none/out.mcap: there is no folder {tmp_path}/none" in capsys.readouterr().err


def test_a_disk_that_is_full_is_told_with_the_file_and_leaves_none(recording, tmp_path, capsys):
    out = tmp_path / "out.mcap"
    out.with_name("out.mcap.active").symlink_to("/dev/full")
    assert cli.main(["replay", str(recording), "--out", str(out)]) == Exit.USER
    assert f"--out {out}: cannot be written: No space left on device" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_recording_without_configuration_needs_one(tmp_path, capsys):
    bare = write(tmp_path / "bare.mcap", toml="")
    assert cli.main(["replay", str(bare)]) == Exit.USER
    assert (
        f"name one with --config; `abs-service new rig.toml --recording {bare}` writes one" in capsys.readouterr().err
    )
    rig = tmp_path / "rig.toml"
    rig.write_text(TOML)
    assert cli.main(["replay", str(bare), "--config", str(rig), "--out", str(tmp_path / "out.mcap")]) == Exit.OK
    assert len(thetas(tmp_path / "out.mcap")) == COUNT


def test_a_recording_that_breaks_off_is_tracked_up_to_there(recording, replayed, tmp_path, capsys):
    whole = recording.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) * 2 // 3])
    assert cli.main(["replay", str(cut), "--out", str(tmp_path / "out.mcap")]) == Exit.OK
    assert "never finished" in capsys.readouterr().err
    estimates = thetas(tmp_path / "out.mcap")
    assert 5 < len(estimates) < COUNT
    assert estimates[:5] == thetas(replayed[0])[:5]


@pytest.mark.parametrize(
    ("toml", "sensors", "message"),
    [
        (TOML, ("tof",), r'tracker "sheet" needs sensor "color", which is not there; the recording has: tof'),
        (TOML.partition("[trackers")[0] + "[record]\n", ("tof", "color"), "trackers: there is none"),
        ("version = 1\nname = 3\n", ("tof", "color"), "rig.toml"),
    ],
)
def test_what_does_not_fit_is_named_and_leaves_no_file(tmp_path, capsys, toml, sensors, message):
    path = write(tmp_path / "x.mcap", toml=toml, sensors=sensors)
    assert cli.main(["replay", str(path)]) == Exit.USER
    assert message in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["x.mcap"]


def test_a_free_name_is_found(tmp_path):
    assert free_path(tmp_path / "a.mcap") == tmp_path / "a_replay.mcap"
    (tmp_path / "a_replay.mcap").touch()
    assert free_path(tmp_path / "a.mcap") == tmp_path / "a_replay_2.mcap"
