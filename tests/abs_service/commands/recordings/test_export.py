"""`abs-service export` for viewers: read by decoders of others, it is what was recorded, in metres."""

import re

import numpy as np
import pytest
from absmsg.v1.frame_info_pb2 import FrameInfo
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from abs_service import cli
from abs_service.commands.recordings import export
from abs_service.supervision.exit_codes import Exit
from drivers.encoding import encoded_image
from drivers.encoding.encoded_image import ImageCodec
from drivers.encoding.mcap_file import McapFile
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    NAMES,
    RGB,
    SIMULATION,
    STATUSES,
    TOML,
    version,
    vertices,
    write_estimated,
)
from tests.abs_service.commands.recordings.simulated_recording import write_take


def messages(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, schema and schema.name, content, message.log_time, message.sequence)
            for schema, channel, message, content in reader.iter_decoded_messages()
        ]


def on(path, topic):
    return [content for name, _, content, _, _ in messages(path) if name == topic]


@pytest.fixture
def recording(tmp_path):
    encode = encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)
    return write_estimated(tmp_path / "x.mcap", encode)


@pytest.fixture
def view(recording, tmp_path):
    assert cli.main(["export", str(recording), "--view-hz", "1000"]) == Exit.OK
    return tmp_path / "x_view.mcap"


def lines_of_sight():
    """Direction (x/z, y/z, 1) of each pixel of the simulated camera, which has no distortion."""
    camera = SIMULATION.heads["tof"].camera
    v, u = np.mgrid[:24, :32]
    return np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)


def radial(k):
    """Measured radial distances [m] of frame k."""
    return next(frame.si() for frame in SIMULATION.frames(k) if (frame.sensor, frame.stream) == ("tof", "depth"))


def test_all_but_depth_is_as_it_was_published(recording, view, tmp_path):
    raw = write_estimated(tmp_path / "raw.mcap")
    changed = {"/tof/depth/image", "/tof/depth/info", "/tof/depth/points", "/sheet/scene"}
    kept = [list(map(str, (one for one in messages(path) if one[0] not in changed))) for path in (view, raw)]
    assert kept[0] == kept[1]
    assert len(kept[0]) > 30
    assert encoded_image.ENCODED_SCHEMA in {schema for _, schema, *_ in messages(recording)}
    with view.open("rb") as stream:
        assert [(one.name, one.data) for one in make_reader(stream).iter_attachments()] == [("rig.toml", TOML.encode())]


def test_depth_images_are_metres_along_the_optical_axis(view):
    images, infos = on(view, "/tof/depth/image"), on(view, "/tof/depth/info")
    assert len(images) == len(infos) == 6
    for k, (image, info) in enumerate(zip(images, infos)):
        assert (image.encoding, image.width, image.height, image.step) == ("32FC1", 32, 24, 4 * 32)
        z = np.frombuffer(image.data, "<f4").reshape(24, 32)
        np.testing.assert_allclose(z, radial(k) / np.linalg.norm(lines_of_sight(), axis=-1), rtol=1e-6)
        assert (info.scale, info.unit, info.geometry) == (1.0, "m", FrameInfo.GEOMETRY_Z)
        assert not info.HasField("invalid")
        assert (info.seq, info.header.t_host_ns) == (k, SIMULATION.time_ns(k))


def test_points_are_the_depth_unprojected(view):
    clouds = on(view, "/tof/depth/points")
    assert len(clouds) == 6
    for k, cloud in enumerate(clouds):
        rays = lines_of_sight()
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        expected = (rays * radial(k)[..., None])[np.isfinite(radial(k))]
        assert [(one.name, one.offset, one.type) for one in cloud.fields] == [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]
        found = np.frombuffer(cloud.data, "<f4").reshape(-1, 3)
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)
        assert (cloud.frame_id, cloud.point_stride) == ("tof", 12)


def test_scenes_are_the_meshes(view):
    scenes = on(view, "/sheet/scene")
    assert len(scenes) == 6
    assert [one.id for one in scenes[0].deletions] == ["sheet"]
    for k, scene in enumerate(scenes[1:], start=1):
        (triangles,) = scene.entities[0].triangles
        np.testing.assert_array_equal([(one.x, one.y, one.z) for one in triangles.points], vertices(k))
        np.testing.assert_array_equal(np.reshape(triangles.indices, (-1, 3)), FACES[version(k)])
        colors = np.array([(one.r, one.g, one.b) for one in triangles.colors]).reshape(-1, 3)
        own = RGB[: len(vertices(k))] / 255 if STATUSES[k] == "TRACKING" else np.zeros((0, 3))
        np.testing.assert_allclose(colors, own)


def test_meshes_and_points_come_at_their_own_rate_and_once(view, recording, tmp_path):
    out = tmp_path / "none.mcap"
    assert cli.main(["export", str(recording), "--out", str(out), "--view-hz", "0"]) == Exit.OK
    assert not {topic for topic, *_ in messages(out)} & {"/tof/depth/points", "/sheet/scene"}
    again = tmp_path / "again.mcap"
    assert cli.main(["export", str(view), "--out", str(again)]) == Exit.OK
    assert list(map(str, messages(again))) == list(map(str, messages(view)))


def test_depth_without_a_camera_is_left_alone_and_named(tmp_path, capsys):
    path = write_take(tmp_path / "x.mcap", SIMULATION, range(2), NAMES)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        kept = [(s, c, m) for s, c, m in reader.iter_messages() if c.topic != "/tof/model"]
    with (tmp_path / "y.mcap").open("wb") as stream:
        file = McapFile(stream)
        for schema, channel, message in kept:
            file.write(channel.topic, schema.name if schema else "", message.data, message.log_time, message.sequence)
        file.finish()
    assert cli.main(["export", str(tmp_path / "y.mcap")]) == Exit.OK
    assert "/tof/depth/image stays as it was recorded, without points: no camera" in capsys.readouterr().err
    assert str(on(tmp_path / "y_view.mcap", "/tof/depth/image")) == str(on(path, "/tof/depth/image"))
    assert str(on(tmp_path / "y_view.mcap", "/tof/depth/info")) == str(on(path, "/tof/depth/info"))


def test_nothing_is_overwritten(recording, tmp_path, capsys):
    out = tmp_path / "out.mcap"
    out.write_bytes(b"mine")
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.USER
    assert f"--out {out}: exists already" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"


def test_what_another_recording_has_left_unfinished_stays(recording, tmp_path, capsys):
    active = tmp_path / "out.mcap.active"
    active.write_bytes(b"hers")
    assert cli.main(["export", str(recording), "--out", str(tmp_path / "out.mcap")]) == Exit.USER
    assert f"--out {tmp_path}/out.mcap: {active} is there, which is being written" in capsys.readouterr().err
    assert active.read_bytes() == b"hers"


@pytest.mark.parametrize("suffix", [".mcap", ".csv", ".npz", ".glb"])
def test_a_folder_that_is_not_there_is_named_with_the_option(recording, tmp_path, capsys, suffix):
    out = tmp_path / "new" / f"x{suffix}"
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.USER
    assert f"error: --out {out}: there is no folder {tmp_path}/new\n" in capsys.readouterr().err
    assert not out.parent.exists()


def test_beside_a_recording_that_is_nowhere_no_option_is_to_blame(tmp_path, capsys):
    assert cli.main(["export", str(tmp_path / "new" / "x.mcap")]) == Exit.USER
    assert "--out" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (lambda data: b"no recording", "x.mcap"),
        (lambda data: data[: len(data) // 2], "abs-service recover"),
        (lambda data: data[:3000] + bytes(200) + data[3200:], "abs-service recover"),
    ],
)
def test_what_is_damaged_leaves_no_copy(recording, tmp_path, capsys, damage, complaint):
    recording.write_bytes(damage(recording.read_bytes()))
    assert cli.main(["export", str(recording)]) == Exit.USER
    assert complaint in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.mcap"]


def test_a_missing_file_is_named(tmp_path, capsys):
    assert cli.main(["export", str(tmp_path / "none.mcap")]) == Exit.USER
    assert "none.mcap: No such file" in capsys.readouterr().err


def test_a_suffix_is_one_of_those_that_are_allowed(capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["export", "x.mcap", "--out", "x.usd"])
    allowed = "argument --out: x.usd: its suffix must be one of .mcap, .csv, .npz, .glb, .obj, .ply, .parquet"
    assert allowed in capsys.readouterr().err


@pytest.mark.parametrize("rate", ["-1", "nan"])
def test_a_rate_is_in_its_range(rate, capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(["export", "x.mcap", "--view-hz", rate])
    assert f"argument --view-hz: '{rate}' must be a rate from 0 to 1000 Hz" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "extra"), [("x.parquet", "parquet"), ("x.mp4", "import"), ("x.rrd", "rerun")])
def test_a_package_that_is_missing_is_named_with_its_extra(recording, tmp_path, capsys, monkeypatch, name, extra):
    monkeypatch.setattr(export, "find_spec", lambda name: None)
    assert cli.main(["export", str(recording), "--out", str(tmp_path / name)]) == Exit.USER
    assert f"pip install -e '.[{extra}]'" in capsys.readouterr().err
    assert not (tmp_path / name).exists()


def test_the_progress_of_a_file_for_rerun_has_its_total(recording, tmp_path, capsys, monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.setenv("FORCE_COLOR", "1")  # a terminal, for rich
    assert cli.main(["export", str(recording), "--out", str(tmp_path / "x.rrd")]) == Exit.OK
    said, progress = capsys.readouterr()
    (written,) = re.findall(r"(\d+) images and estimates", said)
    assert f"{written}/{written}" in progress
