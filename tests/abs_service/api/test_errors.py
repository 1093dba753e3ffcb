"""Arguments that cannot be used: the message names argument, value and the allowed values."""

import numpy as np
import pytest

import abs_service as a
from tests.abs_service.api.scenes import CAMERA, NOISE, Sheet

DEPTH, IMAGE = Sheet().depth(), Sheet().image(CAMERA)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"depth_m": DEPTH[:60]}, r"depth_m has shape \(60, 160\), the camera has 120 × 160"),
        ({"depth_m": (DEPTH * 1000).astype(np.uint16)}, r"depth_m holds uint16, must be floating-point metres"),
        ({"depth_m": DEPTH * 1000}, r"depth_m has a median of 1\d\d\d.*, must be metres"),
        ({"depth_m": -DEPTH}, r"depth_m holds -1\.\d+: must be positive; NaN or 0 means no return"),
        ({"depth_m": DEPTH, "amplitude": DEPTH}, r"amplitude is given, .* no such image; it uses depth_m, image$"),
        ({"depth_m": DEPTH, "streams": {"left/depth": DEPTH}}, r"left/depth is given, .* it uses depth_m, image$"),
        ({"depth_m": DEPTH, "mask": np.ones((60, 160))}, r"mask has shape \(60, 160\), the depth camera has 120 × 160"),
        ({"depth_m": DEPTH, "image": DEPTH}, r"image holds float64 of shape \(120, 160\), must be uint8, 0…255"),
        (
            {"depth_m": DEPTH, "image": IMAGE[..., 0]},
            r"image holds uint8 of shape \(120, 160\), must be .* \(height, width, 3\)",
        ),
        ({"depth_m": DEPTH, "time_s": -1}, r"time_s = -1: must be later than the frame before, 0"),
        ({"depth_m": DEPTH, "time_s": float("nan")}, r"time_s = nan: must be a time in seconds"),
    ],
)
def test_an_array_that_does_not_fit_is_refused(arrays, message):
    tracker = a.Tracker(CAMERA, a.Rigid(), noise=NOISE, color=CAMERA)
    tracker.track(DEPTH, time_s=0, image=IMAGE)
    with pytest.raises(a.ArgumentError, match=message):
        tracker.track(**({"time_s": 1} | arrays))
    assert tracker.track(DEPTH, time_s=0.5, image=IMAGE).status == "TRACKING"  # nothing of the refused call remains


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
        ({"model": a.Nurbs}, r"model = <function Nurbs.*must be settings, such as model = a\.Nurbs\(4, 4\)"),
        ({"model": {"type": "nurb"}}, r'model\.type = "nurb": no such type, did you mean "nurbs"\?'),
        ({"model": "nurbs"}, r'model = "nurbs": must be a table'),
        ({"noise": a.noise.Constant(-1)}, r"^Tracker: noise\.sigma = -1(\.0)?: must be greater than 0"),
        ({"noise": a.noise.Color()}, r'noise: sensor "depth" finds the object, so it needs a noise model of distances'),
        ({"vertices": 2}, r"^Tracker: vertices = 2: must be greater than or equal to 4"),
        ({"range_m": 0}, r"^Tracker: range_m = 0: must be greater than 0"),
        ({"no_return": {"share": 1.5}}, r"^Tracker: no_return\.share = 1\.5: must be less than 1"),
        ({"priors": {"strech": 0.1}}, r"^Tracker: priors\.strech: unknown key, did you mean \"stretch\"\?"),
        ({"color_noise": a.noise.Color()}, r"color_noise is given without the camera: color=Camera"),
        ({"color": CAMERA, "color_noise": a.noise.Color(0)}, r"^Tracker: color_noise\.sigma = 0: must be greater"),
        ({"geometry": "euclidean"}, r"geometry = 'euclidean': must be \"z\" or \"radial\""),
        ({"bayer": "rgbg"}, r"bayer = 'rgbg': must be one of rggb, bggr, grbg, gbrg"),
        ({"budget_ms": 0}, r"budget_ms = 0: must be more than 0, or None"),
    ],
)
def test_a_tracker_that_cannot_be_made_is_refused(arguments, message):
    with pytest.raises(a.ArgumentError, match=message):
        a.Tracker(**({"depth": CAMERA, "model": a.Rigid(), "noise": NOISE} | arguments))


def test_every_error_of_an_argument_is_a_value_error():
    for error in (a.ArgumentError, a.CameraError, a.LensError):
        assert issubclass(error, ValueError)
    with pytest.raises(a.CameraError, match="fx and fy must be positive"):
        a.Camera(640, 480, fx=0, fy=528, cx=320, cy=240)
