"""`abs-service export`: what viewers open holds what was published."""

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from abs_service import cli
from abs_service.supervision.exit_codes import Exit
from drivers.encoding import encoded_image
from drivers.encoding.encoded_image import ImageCodec
from drivers.simulated.address import parse
from tests.abs_service.commands.simulated_recording import write_take

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&sensors=tof,color").build()
NAMES = {"tof": "tof", "color": "color"}


def messages(path):
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, schema and schema.name, content, message.log_time, message.sequence)
            for schema, channel, message, content in reader.iter_decoded_messages()
        ]


@pytest.fixture
def recording(tmp_path):
    encode = encoded_image.encoder(ImageCodec.LOSSLESS, ImageCodec.LOSSLESS)
    return write_take(tmp_path / "x.mcap", SIMULATION, range(3), NAMES, "version = 1\n", encode_image=encode)


def test_a_copy_holds_what_was_published(recording, tmp_path, capsys):
    raw = write_take(tmp_path / "raw.mcap", SIMULATION, range(3), NAMES, "version = 1\n")
    assert cli.main(["export", str(recording)]) == Exit.OK
    copy = tmp_path / "x_raw.mcap"
    assert f"{copy}: " in capsys.readouterr().out
    assert list(map(str, messages(copy))) == list(map(str, messages(raw)))
    assert {schema for topic, schema, *_ in messages(recording) if topic.endswith("/image")} == {
        encoded_image.ENCODED_SCHEMA
    }
    with copy.open("rb") as stream:
        assert [(one.name, one.data) for one in make_reader(stream).iter_attachments()] == [
            ("rig.toml", b"version = 1\n")
        ]


def test_nothing_is_overwritten(recording, tmp_path, capsys):
    out = tmp_path / "out.mcap"
    out.write_bytes(b"mine")
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.USER
    assert "is there already" in capsys.readouterr().err
    assert out.read_bytes() == b"mine"


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
