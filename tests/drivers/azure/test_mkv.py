"""Recordings of the Azure Kinect: synthetic files, written after the format description, are read back in SI units."""

import contextlib
import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib.camera import Camera
from drivers.azure import calibration, colors, mkv
from drivers.azure.calibration import CalibrationError
from drivers.azure.mkv import AzureRecording
from drivers.contract.frame import Geometry, Kind
from drivers.encoding.foreign_recording import ForeignRecordingError

ROTATION = cv2.Rodrigues(np.array([0.09, 0.0, 0.01]))[0]


def camera_entry(location: str, translation: list[float], rotation: Any = ROTATION) -> dict[str, Any]:
    """cx, cy, fx, fy as fractions of the sensor, k1…k6, centre of distortion, p2, p1."""
    parameters = [0.51, 0.52, 0.49, 0.48, 0.5, -0.1, 0.01, 0.8, 0.05, 0.002, 0, 0, -1e-4, 2e-4]
    return {
        "Intrinsics": {
            "ModelType": "CALIBRATION_LensDistortionModelBrownConrady",
            "ModelParameterCount": 14,
            "ModelParameters": parameters,
        },
        "Location": f"CALIBRATION_CameraLocation{location}",
        "Rt": {"Rotation": np.ravel(rotation).tolist(), "Translation": translation},
    }


CAMERAS = [camera_entry("D0", [0, 0, 0], np.eye(3)), camera_entry("PV0", [-0.032, -0.002, 0.004])]
CALIBRATION = json.dumps({"CalibrationInformation": {"Cameras": CAMERAS}}).encode() + b"\0"
DEPTH = np.arange(288 * 320, dtype=np.uint16).reshape(288, 320) % 5000
MODES = {"depth": "NFOV_2X2BINNED", "color": "720P"}


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    av = pytest.importorskip("av", reason="needs PyAV: make all")
    path = tmp_path / "kinect.mkv"
    with av.open(str(path), "w", options={"allow_raw_vfw": "1"}) as file:
        file.metadata.update({"K4A_DEVICE_SERIAL_NUMBER": "0042", "K4A_START_OFFSET_NS": "336000"})
        file.metadata["creation_time"] = "2020-08-31T15:20:37Z"
        tracks = []
        for title, mode in (("DEPTH", "NFOV_2X2BINNED"), ("IR", "ACTIVE")):
            stream = file.add_stream("rawvideo", rate=30)
            stream.width, stream.height, stream.pix_fmt = 320, 288, "gray16be"
            stream.codec_context.codec_tag = "b16g"
            tracks.append((stream, title, mode, [(DEPTH + k).astype(">u2").tobytes() for k in range(2)]))
        colors = [cv2.imencode(".jpg", np.full((720, 1280, 3), (200, 100, 10 * k), np.uint8))[1] for k in range(2)]
        stream = file.add_mux_stream("mjpeg", rate=30, width=1280, height=720)
        tracks.append((stream, "COLOR", "MJPG_720P", [color.tobytes() for color in colors]))
        for stream, title, mode, _ in tracks:
            stream.metadata.update({"title": title, f"K4A_{title}_MODE": mode})
        file.add_attachment("calibration.json", "application/octet-stream", CALIBRATION)
        for k in range(2):
            for stream, _, _, contents in tracks:
                packet = av.Packet(contents[k])
                packet.stream, packet.time_base, packet.is_keyframe = stream, Fraction(1, 1_000_000), True
                packet.pts = packet.dts = k * 66_666
                file.mux(packet)
    return path


def test_depth_infra_red_and_colour_of_a_capture_share_its_number(recording: Path) -> None:
    read = AzureRecording(recording)
    frames = {(frame.kind, frame.seq): frame for frame in read.frames()}
    # Every second image is missing in the file, and the numbers say so.
    assert sorted(frames) == sorted((kind, k) for kind in (Kind.DEPTH, Kind.AMPLITUDE, Kind.COLOR) for k in (0, 2))
    depth = frames[Kind.DEPTH, 2]
    np.testing.assert_array_equal(depth.data, DEPTH + 1)
    assert (depth.scale, depth.geometry, depth.invalid) == (0.001, Geometry.Z, 0.0)
    assert abs(depth.t_device_ticks - (66_666 + 336)) < 1000  # the container of this test counts milliseconds
    assert depth.t_host_ns // 1_000_000_000 == 1_598_887_237
    assert depth.clock_domain == "azure:0042"
    color = frames[Kind.COLOR, 2]
    assert color.encoding == "bgr8"
    assert np.all(np.abs(color.data.astype(int) - [200, 100, 10]) < 6)


def test_cameras_are_those_of_the_sdk(recording: Path) -> None:
    """By the SDK's formulas: a point is projected in units of the sensor, then binned and cut."""
    cameras = AzureRecording(recording).cameras
    point_d = np.array([0.1, -0.05, 0.8])
    for sensor, binned, offset in (("depth", (512, 512), (96, 90)), ("color", (1280, 960), (0, 120))):
        point = point_d if sensor == "depth" else ROTATION @ point_d + [-0.032, -0.002, 0.004]
        cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = CAMERAS[0]["Intrinsics"]["ModelParameters"]
        x, y = point[:2] / point[2]
        r2 = x * x + y * y
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        x, y = (
            x * radial + p2 * (r2 + 2 * x * x) + 2 * p1 * x * y,
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
        expected = (x * fx + cx) * binned[0] - offset[0] - 0.5, (y * fy + cy) * binned[1] - offset[1] - 0.5
        np.testing.assert_allclose(cameras[sensor].project(point_d), expected, atol=1e-9)


def test_other_files_are_rejected_with_their_name(tmp_path: Path) -> None:
    pytest.importorskip("av", reason="needs PyAV: make all")
    for name, content in (("nothing.mkv", None), ("text.mkv", b"no MKV")):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(ForeignRecordingError, match=f"{name}: cannot be read as MKV"):
            AzureRecording(tmp_path / name)


def test_a_corrupt_recording_is_read_or_rejected(recording: Path, tmp_path: Path) -> None:
    content, rng = recording.read_bytes(), np.random.default_rng(11)
    damaged, refused = tmp_path / "damaged.mkv", 0
    for k in range(40):
        changed = bytearray(content[: int(rng.integers(2000, len(content))) if k % 2 else None])
        # Where the container describes its tracks, and anywhere.
        for position in (*rng.integers(min(9000, len(changed)), size=3), *rng.integers(len(changed), size=3)):
            changed[position] = int(rng.integers(256))
        damaged.write_bytes(changed)
        try:
            list(AzureRecording(damaged).frames())
        except ForeignRecordingError:
            refused += 1
    assert refused > 0


@pytest.mark.parametrize(
    ("content", "modes", "complaint"),
    [
        (b"{", MODES, "not understood"),
        (b"[]", MODES, "not understood"),
        (b"{}", MODES, "lacks 'CalibrationInformation'"),
        (CALIBRATION, {"depth": "WIDE"}, "mode 'WIDE' of depth is none of"),
        (CALIBRATION.replace(b"PV0", b"PV1"), MODES, "lacks 'PV0'"),
        (CALIBRATION.replace(b"BrownConrady", b"Rational6KT"), MODES, "Rational6KT"),
        (CALIBRATION.replace(b"[1.0, 0.0", b"[2.0, 0.0"), MODES, "no rotation"),
        (CALIBRATION.replace(b"0.002, 0, 0", b"0.002, 1, 0"), MODES, "centre of distortion"),
    ],
)
def test_an_unsupported_calibration_is_rejected(content: bytes, modes: dict[str, str], complaint: str) -> None:
    with pytest.raises(CalibrationError, match=complaint):
        calibration.cameras(content, modes)


@given(st.lists(st.tuples(st.integers(0, len(CALIBRATION) - 1), st.integers(0, 255)), min_size=1, max_size=8))
def test_a_corrupt_calibration_is_read_or_rejected(changes: list[tuple[int, int]]) -> None:
    content = bytearray(CALIBRATION)
    for position, value in changes:
        content[position] = value
    with contextlib.suppress(CalibrationError):
        assert all(camera.width for camera in calibration.cameras(bytes(content), MODES).values())


@given(st.binary(max_size=200), st.sampled_from(["MJPG", "NV12", "YUY2", "BGRA", ""]), st.booleans())
def test_arbitrary_bytes_are_an_image_or_rejected(content: bytes, encoding: str, begins: bool) -> None:
    jpeg = cv2.imencode(".jpg", np.zeros((6, 8, 3), np.uint8))[1].tobytes()
    camera = Camera(8, 6, 8, 8, 4, 3)
    for read in (lambda data: colors.color(encoding, data, camera), lambda data: mkv.words(data, camera)):
        with contextlib.suppress(ValueError):
            assert read(jpeg[:300] + content if begins else content).shape[:2] == (6, 8)


def test_bgra_loses_its_transparency_alone() -> None:
    content = bytes([200, 100, 50, 255]) * 48
    assert np.all(colors.color("BGRA", content, Camera(8, 6, 8, 8, 4, 3)) == [200, 100, 50])


def test_depth_and_colour_of_a_real_recording_are_registered(data_set: Callable[[str], Path]) -> None:
    pytest.importorskip("av", reason="needs PyAV: make all")
    path = data_set("tof_azure_kinect_pyk4a/recording.mkv")
    read = AzureRecording(path)
    frames = {frame.kind: frame for frame in read.frames()}
    depth = frames[Kind.DEPTH].si()
    assert 0.7 < np.isfinite(depth).mean() < 0.8
    assert np.nanmax(depth) == pytest.approx(3.690)
    assert frames[Kind.DEPTH].seq == frames[Kind.COLOR].seq
    rows, columns = np.nonzero(np.isfinite(depth))
    some = np.random.default_rng(0).choice(len(rows), 500, replace=False)
    v, u = rows[some], columns[some]
    rays = read.cameras["depth"].directions(np.stack([u, v], axis=-1))
    seen = read.cameras["color"].project(rays / rays[:, 2:] * depth[v, u, None])
    inside = np.all((seen > -0.5) & (seen < [1279.5, 719.5]), axis=-1)
    assert inside.mean() > 0.5
