"""`abs-service export x.mp4`: a picture for each estimate, at its time, with the mesh over the images of its moment."""

import numpy as np
import pytest

from abs_service import cli
from abs_service.display.page.pictures import picture, with_mesh
from abs_service.supervision.exit_codes import Exit
from tests.abs_service.commands.recordings.estimated_recording import (
    FACES,
    SIMULATION,
    version,
    vertices,
    write_estimated,
)
from tests.abs_service.export.incomplete_recording import write_without

av = pytest.importorskip("av")

#: Place of each stream in the picture, from left to right.
STREAMS = (("color", "color"), ("tof", "amplitude"), ("tof", "depth"))


NONE = np.zeros((0, 3), np.int32)


def read(path):
    """Times [s] and pictures of a film."""
    with av.open(str(path)) as file:
        assert file.streams.video[0].codec_context.name == "h264"
        return [(frame.time, frame.to_ndarray(format="rgb24")) for frame in file.decode(video=0)]


def drawn(k, faces):
    """Images of exposure k side by side, with the mesh of estimate k."""
    frames = {frame.key: frame for frame in SIMULATION.frames(k)}
    return np.hstack(
        [
            with_mesh(picture(frames[key]), SIMULATION.heads[key[0]].camera, vertices(k).astype(float), faces)
            for key in STREAMS
        ]
    )


def test_a_film_has_a_picture_for_each_estimate(tmp_path):
    recording, out = write_estimated(tmp_path / "x.mcap"), tmp_path / "x.mp4"
    assert cli.main(["export", str(recording), "--out", str(out)]) == Exit.OK
    found = read(out)
    times = [(SIMULATION.time_ns(k) - SIMULATION.time_ns(0)) * 1e-9 for k in range(6)]
    assert [time for time, _ in found] == pytest.approx(times, abs=1e-3)
    gains = []
    for k, (_, image) in enumerate(found):
        assert image.shape == (360 + 28, 3 * 480, 3)
        assert image[360:, :200].max() > 200  # the text
        errors = [np.abs(image[:360].astype(float) - drawn(j, NONE)).mean() for j in range(6)]
        with_own = np.abs(image[:360].astype(float) - drawn(k, FACES.get(version(k), NONE).astype(np.int32))).mean()
        assert min(range(6), key=errors.__getitem__) == k
        assert with_own <= errors[k] < 6
        gains.append(with_own / errors[k])
    assert sum(gain < 0.9 for gain in gains) >= 2  # of the meshes in sight


@pytest.mark.parametrize(
    ("part", "complaint"), [("image", "`abs-service replay --images` writes"), ("model", "has images of its moment")]
)
def test_estimates_without_images_or_cameras_are_no_film(tmp_path, capsys, part, complaint):
    recording = write_without(tmp_path, part)
    assert cli.main(["export", str(recording), "--out", str(tmp_path / "x.mp4")]) == Exit.USER
    assert complaint in capsys.readouterr().err
    assert not [one for one in tmp_path.iterdir() if one.name.startswith("x.mp4")]
