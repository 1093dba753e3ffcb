"""The driver beside Microsoft's own SDK: geometry, player and recorder."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from calib import pose
from drivers.azure import calibration, library, open_device, picture
from drivers.azure.address import FORMATS, parse
from drivers.azure.calibration import COLOR_MODES, DEPTH_MODES
from drivers.azure.controls import Start
from drivers.azure.mkv import AzureRecording
from drivers.azure.picture import AMPLITUDE, COLOR, DEPTH
from drivers.contract.device import DeviceError, DeviceState, SdkMissingError
from drivers.contract.frame import Kind
from tests.drivers.azure.attachment import attached
from tests.drivers.azure.emulation import BEGIN_US, FAILED, EmulatedKinect, EmulatedSdk
from tests.drivers.azure.microsoft import Microsoft
from tests.drivers.azure.test_mkv import CALIBRATION
from tests.drivers.recording_sink import RecordingSink

try:
    MICROSOFT = Microsoft()
except SdkMissingError as error:
    pytest.skip(str(error), allow_module_level=True)

RECORDING = "tof_azure_kinect_pyk4a/recording.mkv"


@pytest.mark.parametrize("depth", DEPTH_MODES)
@pytest.mark.parametrize("color", COLOR_MODES)
def test_projections_are_those_of_the_sdk_in_all_modes(depth: str, color: str, data_set: Callable[[str], Path]) -> None:
    with MICROSOFT.player(data_set(RECORDING)) as (raw, _):
        cameras, theirs = (
            calibration.cameras(raw, {"depth": depth, "color": color}),
            MICROSOFT.calibration(raw, depth, color),
        )
    rng = np.random.default_rng(3)
    points_d = rng.uniform([-0.4, -0.3, 0.5], [0.4, 0.3, 1.5], (200, 3))
    for head, camera in cameras.items():
        expected = MICROSOFT.project(theirs, points_d, head)
        inside = np.isfinite(expected).all(axis=1)
        assert inside.sum() > 50
        # The SDK computes with 32 bits; the largest difference is 0.0004 px.
        np.testing.assert_allclose(camera.project(points_d)[inside], expected[inside], atol=1e-3)


def test_depth_is_along_z_and_points_are_those_of_the_sdk(data_set: Callable[[str], Path]) -> None:
    with MICROSOFT.player(data_set(RECORDING)) as (raw, captures):
        camera = calibration.cameras(raw, {"depth": "NFOV_UNBINNED"})["depth"]
        (shot,) = picture.pictures(MICROSOFT.sdk, captures[0], (DEPTH,))
        theirs = MICROSOFT.calibration(raw, "NFOV_UNBINNED", "720P")
    made = picture.frame(shot, camera, 0, "")
    places = np.argwhere(np.isfinite(made.si()))
    pixels = np.random.default_rng(5).choice(places, 2000, replace=False)[:, ::-1]
    u, v = pixels.T
    expected = MICROSOFT.points(theirs, pixels, made.data[v, u])
    inside = np.isfinite(expected).all(axis=1)
    assert inside.mean() > 0.99
    rays = camera.directions(pixels)
    points = rays / rays[:, 2:] * made.si()[v, u, None]
    np.testing.assert_allclose(points[inside], expected[inside], atol=2e-5)


def test_whole_images_are_transformed_as_by_the_sdks_engine(data_set: Callable[[str], Path]) -> None:
    """Run it with `xvfb-run -a .venv/bin/pytest tests/drivers/azure/test_microsoft.py` where no X session is."""
    with MICROSOFT.player(data_set(RECORDING)) as (raw, captures):
        theirs = MICROSOFT.calibration(raw, "NFOV_UNBINNED", "720P")
        cameras = calibration.cameras(raw, {"depth": "NFOV_UNBINNED", "color": "720P"})
        (shot,) = picture.pictures(MICROSOFT.sdk, captures[0], (DEPTH,))
        image = MICROSOFT.sdk.k4a_capture_get_depth_image(captures[0])
        try:
            with MICROSOFT.engine(theirs) as engine:
                if not engine:
                    pytest.skip(library.reason())
                cloud_mm = MICROSOFT.cloud(engine, image, (640, 576))
                warped_mm = MICROSOFT.in_color(engine, image, (1280, 720))
        finally:
            MICROSOFT.sdk.k4a_image_release(image)
    z_m = picture.frame(shot, cameras["depth"], 0, "").si()
    v, u = np.nonzero(np.isfinite(z_m))
    rays = cameras["depth"].directions(np.stack([u, v], axis=-1))
    points_d = rays / rays[:, 2:] * z_m[v, u, None]
    assert np.abs(1e3 * points_d - cloud_mm[v, u]).max() < 0.51  # whole millimetres

    pixels = np.floor(cameras["color"].project(points_d) + 0.5).astype(int)
    inside = np.all((pixels >= 0) & (pixels < [1280, 720]), axis=1)
    seen_mm = warped_mm[pixels[inside, 1], pixels[inside, 0]].astype(float)
    T_cd = pose.inverse(cameras["color"].T_rs)
    expected_mm = 1e3 * pose.transform(T_cd, points_d[inside])[:, 2]
    assert (seen_mm > 0).mean() > 0.95  # the rest lies behind something nearer, or at the rim
    errors_mm = np.abs(seen_mm - expected_mm)[seen_mm > 0]
    assert np.median(errors_mm) < 1
    assert (errors_mm < 5).mean() > 0.95


def test_an_engine_that_cannot_draw_says_what_it_needs(
    tmp_path: Path, data_set: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    with MICROSOFT.player(data_set(RECORDING)) as (raw, _):
        theirs, camera = MICROSOFT.calibration(raw, "NFOV_UNBINNED", "720P"), EmulatedKinect("0001", raw)

    def start(*_: object) -> int:
        with MICROSOFT.engine(theirs) as engine:  # the engine for images, from the same library as that for depth
            return 0 if engine else FAILED

    monkeypatch.setattr(EmulatedSdk, "k4a_device_start_cameras", start)
    monkeypatch.setenv("DISPLAY", "")
    with attached(tmp_path, camera):
        device, sink = open_device("azure://", time.monotonic_ns), RecordingSink()
        with pytest.raises(DeviceError, match=r"error code: 204.*; it needs OpenGL 4\.4 in an X session"):
            device.start(sink)
        assert sink.wait_for(DeviceState.FAILED)
        device.close()
    assert not camera.open


def test_captures_of_the_sdks_player_are_the_images_that_import_reads(data_set: Callable[[str], Path]) -> None:
    path = data_set(RECORDING)
    read = AzureRecording(path)
    imported = {frame.kind: frame for frame in read.frames()}
    with MICROSOFT.player(path) as (_, captures):
        shots = [*picture.pictures(MICROSOFT.sdk, captures[0], (DEPTH, AMPLITUDE, COLOR))]
    assert {shot.role.kind for shot in shots} == set(imported)
    for shot in shots:
        made, other = picture.frame(shot, read.cameras[shot.role.sensor], 0, ""), imported[shot.role.kind]
        np.testing.assert_array_equal(made.data, other.data)
        for name in (
            "key",
            "encoding",
            "scale",
            "geometry",
            "invalid",
            "unit",
            "calib_id",
            "t_device_ticks",
            "t_reference",
        ):
            assert getattr(made, name) == getattr(other, name), name


def recorded(folder: Path, uri: str, numbers: list[int]) -> Path:
    """A recording by Microsoft's recorder of exposures with some numbers."""
    start, path = Start(parse(uri)), folder / "recorded.mkv"
    camera = EmulatedKinect("0042", CALIBRATION, started=[start.configuration()])
    emulated = EmulatedSdk(MICROSOFT.sdk, camera)
    captures = [emulated.exposure(camera, number, 30) for number in numbers]
    MICROSOFT.record(path, start.configuration(), CALIBRATION, captures)
    return path


@pytest.mark.parametrize("form", FORMATS)
def test_what_the_sdks_recorder_writes_is_imported(tmp_path: Path, form: str) -> None:
    path = recorded(tmp_path, f"azure://?depth=nfov_2x2binned&format={form.lower()}", [0, 1, 4])
    frames = [*AzureRecording(path).frames()]
    assert sorted((frame.kind, frame.seq) for frame in frames) == sorted(
        (kind, seq) for kind in (Kind.DEPTH, Kind.AMPLITUDE, Kind.COLOR) for seq in (0, 1, 4)
    )
    depth = next(frame for frame in frames if frame.kind == Kind.DEPTH)
    assert depth.t_device_ticks == BEGIN_US
    assert 0.9 < np.nanmin(depth.si()) < np.nanmax(depth.si()) < 1.1


def test_infra_red_without_the_cameras_light_is_no_amplitude(tmp_path: Path) -> None:
    (frame,) = AzureRecording(recorded(tmp_path, "azure://?depth=passive_ir&color=0", [0])).frames()
    assert (frame.kind, frame.stream, frame.data.shape) == (Kind.IR, "ir", (1024, 1024))
