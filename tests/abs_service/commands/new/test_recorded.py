"""`abs-service new --recording` writes the rig file that a recording without one is replayed with."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from abs_service import cli
from abs_service.commands.new import new, recorded
from abs_service.supervision.exit_codes import Exit
from drivers.contract.device import Truth
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.address import parse
from tests.abs_service.commands.recordings.simulated_recording import write_take
from tests.drivers.o3r import pcic_messages

SIMULATION = parse("simulated://sheet?tof=32x24&color=32x24&rate=10").build()
ANSWERS = ["--object", "sheet", "--behind", "space"]


def take(path: Path, names: dict[str, str]) -> Path:
    return write_take(path, SIMULATION, range(3), names)


def test_sensors_noise_and_tolerance_follow_from_the_images(tmp_path, capsys):
    recording = take(tmp_path / "my take.mcap", {"tof": "range", "color": "eye"})
    rig = tmp_path / "rig.toml"
    assert cli.main(["new", str(rig), "--recording", str(recording), *ANSWERS, "--color"]) == Exit.OK
    assert f"abs-service replay '{recording}' --images --config {rig}" in capsys.readouterr().out
    table = tomllib.loads(rig.read_text())
    assert {name: sensor["noise"]["type"] for name, sensor in table["sensors"].items()} == {
        "range": "constant",  # it has amplitudes beside its distances, so it is a time-of-flight camera
        "eye": "color",
    }
    assert table["trackers"]["object"]["sensors"] == ["range", "eye"]
    assert table["synchronisation"] == {"reference": "range/depth", "tolerance_ms": 50.0}  # half of 0.1 s
    assert cli.main(["check", str(rig)]) == Exit.OK
    assert cli.main(["check", str(rig), "--replay", str(recording)]) == Exit.OK


@pytest.mark.parametrize(
    ("head", "model"), [("tof", "constant"), ("left_tof2", "constant"), ("autofocus", "structured_light")]
)
def test_distances_alone_are_weighed_by_the_name_of_their_head(tmp_path, capsys, head, model):
    rig, recording = tmp_path / "rig.toml", tmp_path / "x.mcap"
    write_take(recording, Scattering(1.0e-3), range(2), {"structured_light": head})
    assert cli.main(["new", str(rig), "--recording", str(recording), *ANSWERS]) == Exit.OK
    assert tomllib.loads(rig.read_text())["sensors"][head]["noise"]["type"] == model
    said = f"{head} is taken for structured light or stereo, as it has no amplitudes beside"
    assert [said in text for text in (rig.read_text(), capsys.readouterr().out)] == [model == "structured_light"] * 2


class Scattering:
    """A wall at half a metre, whose inverse distances scatter, as a simulation's images."""

    def __init__(self, noise: float) -> None:
        self._simulation = parse("simulated://sheet?sensors=structured_light&structured_light=160x120").build()
        self.heads, self._noise = self._simulation.heads, noise

    def frames(self, k: int) -> list[Frame]:
        def scattered(frame: Frame) -> Frame:
            inverse = 2.0 + self._noise * np.random.default_rng(k).standard_normal(frame.data.shape)
            return replace(frame, data=(1 / inverse).astype("<f4"), encoding="32FC1", scale=1.0, invalid=None)

        return [scattered(frame) for frame in self._simulation.frames(k)]

    def truths(self, k: int) -> list[Truth]:
        return []


@pytest.mark.parametrize(("noise", "written"), [(1.0e-3, 1.425e-3), (4.0e-3, 4.0e-3)])
def test_a_camera_that_scatters_more_than_usual_is_weighed_less(tmp_path, noise, written):
    """Half of the vertices of a good estimate would not seem to agree, and it would be DEGRADED."""
    rig, recording = tmp_path / "rig.toml", tmp_path / "x.mcap"
    write_take(recording, Scattering(noise), range(2), {"structured_light": "depth"})
    assert cli.main(["new", str(rig), "--recording", str(recording), *ANSWERS]) == Exit.OK
    model = tomllib.loads(rig.read_text())["sensors"]["depth"]["noise"]
    assert (model["type"], model["noise"]) == ("structured_light", pytest.approx(written, rel=0.1))
    assert cli.main(["check", str(rig)]) == Exit.OK


class Infrared(Scattering):
    """The same wall with infra-red images, of the depth camera and of others."""

    def __init__(self, *heads: str) -> None:
        super().__init__(1.0e-3)
        self.heads = dict.fromkeys(["structured_light", *heads], self.heads["structured_light"])

    def frames(self, k: int) -> list[Frame]:
        (depth,) = super().frames(k)
        picture = {"stream": "ir", "kind": Kind.IR, "geometry": Geometry.NONE, "encoding": "mono8", "unit": "dn"}
        grey = np.full(depth.data.shape, 9, np.uint8)
        return [depth, *(replace(depth, sensor=head, data=grey, **picture) for head in self.heads)]


@pytest.mark.parametrize(("others", "model"), [((), "constant"), (("right",), "structured_light")])
def test_a_pair_of_infrared_images_is_stereo(tmp_path, others, model):
    rig, recording = tmp_path / "rig.toml", tmp_path / "x.mcap"
    write_take(recording, Infrared(*others), range(2), {"structured_light": "depth"} | dict(zip(others, others)))
    assert cli.main(["new", str(rig), "--recording", str(recording), *ANSWERS]) == Exit.OK
    assert tomllib.loads(rig.read_text())["sensors"]["depth"]["noise"]["type"] == model


def test_of_several_depth_sensors_the_first_is_taken_and_the_others_are_told(tmp_path, capsys):
    simulation, rig = parse("simulated://sheet?sensors=tof,structured_light&tof=32x24").build(), tmp_path / "rig.toml"
    recording = write_take(tmp_path / "x.mcap", simulation, range(3), {"tof": "right", "structured_light": "left"})
    assert cli.main(["new", str(rig), "--recording", str(recording), *ANSWERS]) == Exit.OK
    note = "Depth images of left; the recording has those of right as well."
    assert note in capsys.readouterr().out
    assert f"describes it.\n# {note}\n[devices.camera]" in rig.read_text()


def test_motion_is_looked_for_in_half_of_a_short_recording(tmp_path):
    rig, recording = tmp_path / "rig.toml", write_take(tmp_path / "x.mcap", SIMULATION, range(21), {"tof": "tof"})
    answers = ["--object", "body", "--behind", "things"]
    assert cli.main(["new", str(rig), "--recording", str(recording), *answers]) == Exit.OK
    assert tomllib.loads(rig.read_text())["trackers"]["object"]["region"] == {"type": "seed", "motion_s": 1.0}


def test_a_single_image_with_deviations_is_weighed_with_them(tmp_path):
    out, rig = tmp_path / "out.mcap", tmp_path / "rig.toml"
    (tmp_path / "buffer.data").write_bytes(pcic_messages.exposure())
    assert cli.main(["import", str(tmp_path / "buffer.data"), "--layout", "o3r", "--out", str(out)]) == Exit.OK
    assert cli.main(["new", str(rig), "--recording", str(out), *ANSWERS]) == Exit.OK
    table = tomllib.loads(rig.read_text())
    assert table["sensors"]["depth"]["noise"]["type"] == "measured"
    assert table["synchronisation"]["tolerance_ms"] == 17.0


@pytest.mark.parametrize(
    ("names", "options", "said"),
    [
        ({"tof": "tof"}, ["--color"], "--color: recording x.mcap has no colour camera"),
        ({"tof": "tof"}, ["--device", "kinect1"], "--recording: the file takes the place of a device"),
        ({"color": "color"}, ["--no-color"], "there are no depth images in it"),
    ],
)
def test_what_the_recording_cannot_give_is_refused(tmp_path, capsys, names, options, said):
    recording, rig = take(tmp_path / "x.mcap", names), tmp_path / "rig.toml"
    assert cli.main(["new", str(rig), "--recording", str(recording), *ANSWERS, *options]) == Exit.USER
    assert said in capsys.readouterr().err
    assert not rig.exists()


def test_a_person_who_has_no_camera_is_asked_for_a_recording(tmp_path):
    path = take(tmp_path / "x.mcap", {"tof": "tof"})
    said = {"device": "recording", "recording": str(path), "object": "rigid", "behind": "plane"}
    arguments = cli.command_parser("new", new).parse_args(["x.toml"])
    answers = new.answered(arguments, "x", [], lambda option, question, choices: said[option])  # not for colours
    assert (answers.device.head, answers.uri, answers.color) == ("tof", f"replay://{path}", False)


def test_of_several_depth_sensors_the_first_by_name_is_taken(tmp_path):
    both = parse("simulated://sheet?tof=32x24&structured_light=32x24&sensors=tof,structured_light").build()
    first = recorded.device(write_take(tmp_path / "x.mcap", both, range(2), {"structured_light": "a", "tof": "b"}))
    assert (first.head, first.color) == ("a", None)
