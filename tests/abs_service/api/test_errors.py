"""Arguments that cannot be used: the message names argument, value and the allowed values."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import abs_service as a
from tests.abs_service.api.scenes import CAMERA, NOISE, Sheet

SAMPLE = Path(__file__).parents[3] / "recordings" / "sample.mcap"
DEPTH, IMAGE = Sheet().depth(), Sheet().image(CAMERA)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (
            {"depth_m": DEPTH[:60]},
            r"depth_m has shape \(60, 160\), must be \(120, 160\), \(height, width\) of its camera$",
        ),
        ({"depth_m": DEPTH.T}, r"depth_m has shape \(160, 120\), must be \(120, 160\), .*; it is transposed$"),
        ({"depth_m": DEPTH.astype(np.uint8)}, r"depth_m holds uint8, .* unless it is given cv2\.IMREAD_UNCHANGED"),
        ({"depth_m": (DEPTH * 1000).astype(np.uint16)}, r"depth_m holds uint16, must be floating-point metres"),
        ({"depth_m": DEPTH * 1000}, r"depth_m has a median of 1\d\d\d.*, must be metres"),
        ({"depth_m": -DEPTH}, r"depth_m holds -1\.\d+: must be positive; NaN or 0 means no return"),
        ({"depth_m": DEPTH, "amplitude": DEPTH}, r"amplitude is given, .* no such image; it uses depth_m, image$"),
        ({"depth_m": DEPTH, "streams": {"left/depth": DEPTH}}, r"left/depth is given, .* it uses depth_m, image$"),
        ({"depth_m": DEPTH, "mask": np.ones((60, 160))}, r"mask has shape \(60, 160\), must be \(120, 160\)"),
        ({"depth_m": DEPTH, "image": DEPTH}, r"image holds float64 of shape \(120, 160\), must be uint8, 0…255"),
        (
            {"depth_m": DEPTH, "image": IMAGE[..., 0]},
            r"image holds uint8 of shape \(120, 160\), must be .* \(height, width, 3\)",
        ),
        ({"depth_m": DEPTH, "time_s": -1}, r"time_s = -1: must be later than the frame before, 0"),
        ({"depth_m": DEPTH, "time_s": float("nan")}, r"time_s = nan: must be a time in seconds"),
        ({"depth_m": DEPTH, "time_s": "x"}, r"time_s = 'x': must be a time in seconds"),
        ({"depth_m": DEPTH, "time_s": None}, r"time_s = None: must be a time in seconds"),
        ({"depth_m": DEPTH, "time_s": np.array([1, 2])}, r"time_s = array\(\[1, 2\]\): must be a time in seconds"),
        (
            {"depth_m": DEPTH, "time_s": 1.7e12},
            r"time_s = 1700000000000\.0: must be a time in seconds, less than 9e\+09: milliseconds \* 1e-3, nanosec",
        ),
        ({"depth_m": np.full_like(DEPTH, 1e300)}, r"depth_m has a median of 1e\+300, must be metres"),
        ({"depth_m": [[1.0], [1.0, 2.0]]}, r"depth_m is no array: .*inhomogeneous"),
        ({"depth_m": np.ma.masked_greater(DEPTH, 1)}, r"depth_m is a masked array: must be a plain one"),
        ({"depth_m": DEPTH[..., None]}, r"depth_m has shape \(120, 160, 1\), must be \(120, 160\)"),
        ({"depth_m": DEPTH, "image": IMAGE / 255}, r"image holds float64 of shape .*, must be uint8, 0…255"),
        ({"depth_m": DEPTH, "mask": np.full_like(DEPTH, np.nan)}, r"mask holds NaN, must be boolean, or numbers"),
        ({"depth_m": DEPTH, "mask": np.full(DEPTH.shape, "a")}, r"mask holds <U1, must be boolean, or numbers"),
        ({"depth_m": DEPTH, "streams": 5}, r"streams = 5: must be a dict such as"),
        (
            {"depth_m": DEPTH, "streams": {"depth/depth": DEPTH}},
            r"depth/depth is given, and depth_m too, .* same image",
        ),
    ],
)
def test_an_array_that_does_not_fit_is_refused(arrays, message):
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE, color=CAMERA)
    tracker.track(DEPTH, time_s=0, image=IMAGE)
    with pytest.raises(a.ArgumentError, match=message):
        tracker.track(**({"time_s": 1} | arrays))
    assert tracker.track(DEPTH, time_s=0.5, image=IMAGE).status == "TRACKING"  # nothing of the refused call remains


def test_lists_and_other_floats_are_arrays_too():
    for depth in (DEPTH.tolist(), DEPTH.astype(">f4"), DEPTH.astype(np.float16)):
        assert a.Tracker(CAMERA, a.Rigid(), noise=NOISE).track(depth, time_s=0).status == "TRACKING"


def test_amplitudes_are_not_negative():
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=a.noise.TofAmplitude((0.001,), 1.0))
    with pytest.raises(a.ArgumentError, match=r"amplitude holds -1\..*: must be positive"):
        tracker.track(DEPTH, time_s=0, amplitude=-DEPTH)


@pytest.mark.parametrize(
    ("noise", "missing"),
    [(a.noise.TofAmplitude((0.001,), 1.0), "amplitude"), (a.noise.Measured(), "deviation_m")],
)
def test_what_a_noise_model_depends_on_must_be_given(noise, missing):
    with pytest.raises(a.ArgumentError, match=rf'{missing} is missing: the noise model of "depth" depends on it'):
        a.Tracker(CAMERA, a.Rigid(), noise=noise).track(DEPTH, time_s=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"model": a.Nurbs(2, 4)}, r"^Tracker: model\.control_points\[0\] = 2: must be greater than or equal to 3"),
        ({"model": a.Nurbs}, r"model = <function Nurbs.*must be settings, such as model=a\.Nurbs\(4, 4\)"),
        ({"model": {"type": "nurb"}}, r'model\.type = "nurb": no such type, did you mean "nurbs"\?'),
        ({"model": "nurbs"}, r"model = 'nurbs': must be settings, such as model=a\.Nurbs\(4, 4\), or a table"),
        ({"noise": a.noise.Constant(-1)}, r"^Tracker: noise\.sigma = -1(\.0)?: must be greater than 0"),
        ({"noise": a.noise.Constant(3)}, r"^Tracker: noise\.sigma = 3(\.0)?: must be less than or equal to 0\.5"),
        ({"noise": a.noise.Color()}, r'noise = GaussianColor\(sigma=15\.0\): "depth" .* needs a model of distances'),
        ({"vertices": 2}, r"^Tracker: vertices = 2: must be greater than or equal to 4"),
        ({"range_m": 0}, r"^Tracker: range_m = 0: must be greater than 0"),
        ({"no_return": {"share": 1.5}}, r"^Tracker: no_return\.share = 1\.5: must be less than 1"),
        ({"priors": {"strech": 0.1}}, r"^Tracker: priors\.strech: unknown key, did you mean \"stretch\"\?"),
        (
            {"color_noise": a.noise.Color()},
            r"color_noise = .*\(sigma=15\.0\): must be None without .*color=Camera",
        ),
        ({"color": CAMERA, "color_noise": a.noise.Color(0)}, r"^Tracker: color_noise\.sigma = 0: must be greater"),
        ({"geometry": "euclidean"}, r"geometry = 'euclidean': must be \"z\" or \"radial\""),
        ({"bayer": "rgbg"}, r"bayer = 'rgbg': must be one of rggb, bggr, grbg, gbrg"),
        ({"budget_ms": 0}, r"budget_ms = 0: must be more than 0, or None"),
        ({"budget_ms": "5"}, r"budget_ms = '5': must be more than 0, or None"),
        ({"budget_ms": True}, r"budget_ms = True: must be more than 0, or None"),
        ({"depth": None}, r"depth = None: must be a camera, such as Camera\(640, 480"),
        ({"depth": 5}, r"depth = 5: must be a camera"),
        ({"color": 4}, r"color = 4: must be a camera"),
        (
            {"color": CAMERA, "color_noise": a.noise.StructuredLight()},
            r"color_noise = Structured.*: must be noise\.Color",
        ),
        (
            {"color": CAMERA, "color_noise": a.noise.Intensity("amplitude", 5)},
            r"color_noise = .*: must be noise\.Color",
        ),
        (
            {"noise": 0.002},
            r"^noise = 0\.002: must be settings, such as noise=a\.noise\.Constant\(0\.001\), or a table",
        ),
        (
            {"color": CAMERA, "color_noise": 3},
            r"^color_noise = 3: must be settings, such as color_noise=a\.noise\.Color",
        ),
        ({"texture": 3}, r"^texture = 3: must be settings, such as texture=a\.noise\.Intensity"),
        ({"region": "nearest"}, r'region = "nearest": must be a table such as {"type": "nearest", …}; types'),
        ({"region": {"typ": "nearest"}}, r'region\.typ: unknown key, did you mean "type"\? types: above_plane'),
        ({"region": {"type": "mask"}}, r"region\.file: missing, .*; pixels are given to track\(…, mask=array\)"),
        (
            {"noise": a.noise.Constant},
            r"noise = <class .*must be settings, such as noise=a\.noise\.Constant\(0\.001\)",
        ),
        ({"texture": a.noise.Constant(0.001)}, r'texture\.type = "constant": must be intensity, color, grey or bayer'),
        ({"region": {"type": "mask", "file": "/no.png"}}, r"^region\.file = '/no\.png': cannot be read: No such file"),
        ({"template": {"type": "mesh", "path": "/no.obj"}}, r"^template\.path = '/no\.obj': there is no such file"),
        ({"region": np.ones((3, 3))}, r"^Tracker: region = .*: must be a table"),
        ({"bayer": ["rggb"]}, r"bayer = \['rggb'\]: must be one of rggb"),
    ],
)
def test_a_tracker_that_cannot_be_made_is_refused(arguments, message):
    with pytest.raises(a.ArgumentError, match=message):
        a.Tracker(**({"depth": CAMERA, "model": a.Rigid(), "noise": NOISE} | arguments))


def test_an_error_of_an_argument_hides_the_configuration_that_is_made_of_it():
    with pytest.raises(a.ArgumentError) as raised:
        a.Tracker(CAMERA, a.Rigid(), region={"type": "mask"})
    assert raised.value.__suppress_context__
    assert raised.value.__cause__ is None


@pytest.mark.parametrize("nothing", [0.0, np.nan])
def test_an_image_without_any_return_is_named_before_all_advice(nothing):
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE)
    empty = np.full_like(DEPTH, nothing)
    for time_s, depth_m, status in ((0, empty, "INITIALIZING"), (1, DEPTH, "TRACKING"), (2, empty, "LOST")):
        estimate = tracker.track(depth_m, time_s=time_s)
        assert estimate.status == status
        assert estimate.reasons[:1] == (
            () if status == "TRACKING" else ("depth_m has no return: all of it is 0 or NaN",)
        )


def test_every_error_of_an_argument_is_a_value_error():
    for error in (a.ArgumentError, a.CameraError, a.LensError):
        assert issubclass(error, ValueError)
    with pytest.raises(a.CameraError, match="fx = 0: must be positive"):
        a.Camera(640, 480, fx=0, fy=528, cx=320, cy=240)


def test_numbers_of_numpy_are_numbers():
    sigma: Any = np.float32(0.001)
    numbers: dict[str, Any] = {"vertices": np.int64(200), "budget_ms": np.float32(500)}
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=a.noise.Constant(sigma), **numbers)
    assert 100 < len(tracker.track(DEPTH, time_s=0).vertices) < 400


@pytest.mark.parametrize(
    ("call", "argument", "message"),
    [
        (a.Tracker(CAMERA, a.Rigid()).replay, 5, r"recording = 5: must be a recording, open_recording\(path\)"),
        (a.Tracker(CAMERA, a.Rigid()).replay, "x.mcap", r"recording = 'x\.mcap': must be a recording"),
        (a.open_recording, 5, r"path = 5: must be the path of a file"),
        (a.Recording, None, r"path = None: must be the path of a file"),
        (a.load_rig, None, r"path = None: must be the path of a file"),
        (a.Nurbs, 4, r"long = 4, short = None: give both, or neither"),
        (lambda weights: a.Nurbs(4, 4, weights=weights), ((1.0, 2.0),), r"Nurbs: weights must be 4 rows of 4"),
    ],
)
def test_a_call_with_something_else_is_refused(call, argument, message):
    with pytest.raises(a.ArgumentError, match=message):
        call(argument)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": 5}, r"name = 5: must be a tracker of the rig, sheet"),
        ({"cameras": 5}, r"cameras = 5: must be a dict such as"),
        ({"cameras": {"tof": 5}}, r"cameras\['tof'\] = 5: must be a camera"),
        ({"budget_ms": "x"}, r"budget_ms = 'x': must be more than 0"),
    ],
)
def test_a_tracker_of_a_rig_that_cannot_be_made_is_refused(arguments, message):
    rig = a.open_recording(SAMPLE).rig
    with pytest.raises(a.ArgumentError, match=message):
        rig.tracker(**arguments)
