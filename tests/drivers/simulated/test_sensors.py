"""The simulated heads follow their declared noise models."""

import numpy as np
import pytest

from calib.noise.gaussian_polynomial import GaussianPolynomial
from drivers.contract.device import Truth
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.address import parse
from drivers.simulated.sensors.time_of_flight import SIGMA_POLYNOMIAL, TimeOfFlight, TimeOfFlightNoise
from drivers.simulated.sensors.view import View
from drivers.simulated.simulation import Simulation


def build(query: str, name: str = "sheet") -> Simulation:
    return parse(f"simulated://{name}?{query}").build()


def expose(simulation: Simulation, k: int) -> tuple[dict[str, Frame], Truth]:
    frames, truth = simulation.expose(k)
    return {f"{frame.sensor}/{frame.stream}": frame for frame in frames}, truth


def inner(truth: Truth) -> np.ndarray:
    return truth.points_r[2:-2, 2:-2].reshape(-1, 3)


def at(simulation: Simulation, name: str, points_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.floor(simulation.heads[name].camera.project(points_r) + 0.5).astype(int).T
    return v, u


ALL = "sensors=tof,structured_light,color,bayer,ir"


def test_the_same_seed_gives_the_same_bits_in_any_order() -> None:
    first, second, other = build(ALL + "&seed=3"), build(ALL + "&seed=3"), build(ALL + "&seed=4")
    a, _ = expose(first, 70)
    expose(second, 5)
    b, _ = expose(second, 70)
    c, _ = expose(other, 70)
    assert a.keys() == b.keys()
    for name in a:
        np.testing.assert_array_equal(a[name].data, b[name].data)
        assert not np.array_equal(a[name].data, c[name].data)


def test_noise_differs_from_exposure_to_exposure_and_from_head_to_head() -> None:
    simulation = build("seed=1")
    a, _ = expose(simulation, 0)
    b, _ = expose(simulation, 1)  # at rest: the same scene
    assert not np.array_equal(a["tof/depth"].data, b["tof/depth"].data)
    assert not np.array_equal(a["color/color"].data, b["color/color"].data)


@pytest.mark.parametrize("lens", ["0", "-0.25,0.06,0.002,-0.003", "0.3"])
@pytest.mark.parametrize("k", [0, 100, 150, 333])
def test_without_noise_the_truth_is_what_time_of_flight_measures(k: int, lens: str) -> None:
    simulation = build(f"sensors=tof&noise=0&tof=352x288&lens={lens}")
    frames, truth = expose(simulation, k)
    depth = frames["tof/depth"]
    assert depth.geometry == Geometry.RADIAL
    pixels = at(simulation, "tof", inner(truth))
    measured = depth.si()[pixels]
    camera = simulation.heads["tof"].camera
    # Half a pixel off the projected point, the surface may be as much nearer as its slope tells.
    assert np.median(np.abs(measured - camera.distance(inner(truth)))) < 5e-4
    assert np.max(np.abs(measured - camera.distance(inner(truth)))) < 4e-3


@pytest.mark.parametrize("k", [0, 150])
def test_structured_light_measures_z_in_disparity_steps(k: int) -> None:
    simulation = build("sensors=structured_light&noise=0")
    frames, truth = expose(simulation, k)
    depth = frames["structured_light/depth"]
    assert depth.geometry == Geometry.Z
    z = depth.si()
    measured = z[at(simulation, "structured_light", inner(truth))]
    valid = np.isfinite(measured)
    assert valid.mean() > 0.9
    assert np.max(np.abs(measured - inner(truth)[:, 2])[valid]) < 6e-3
    steps = 1 / z[np.isfinite(z)] / 2.85e-3
    assert np.max(np.abs(steps - np.rint(steps))) < 0.5e-3 / 2.85e-3 / 0.8**2  # millimetres are steps, too
    levels = np.unique(z[np.isfinite(z) & (z < 1.3)])
    assert np.all(np.diff(levels) > 0.0019)


def test_structured_light_has_holes_at_the_rim_and_in_the_shadow() -> None:
    simulation = build("sensors=structured_light&noise=0")
    z = expose(simulation, 0)[0]["structured_light/depth"].si()
    row = z[z.shape[0] // 2]
    sheet = np.flatnonzero(row < 1.3)
    holes = np.flatnonzero(np.isnan(row))
    shadow = holes[holes < sheet[0]]
    # Baseline 75 mm, f = 288 px, sheet at 1.0 m before a wall at 1.6 m: 8.1 px, and the rim.
    assert 8 <= shadow.size <= 10
    assert np.all(np.diff(shadow) == 1)
    assert np.count_nonzero(holes > sheet[-1]) <= 1


def test_sigma_and_offset_of_time_of_flight_follow_the_declared_model() -> None:
    simulation = build("sensors=tof&offset=0.02")
    head = simulation.heads["tof"]
    assert isinstance(head, TimeOfFlight)
    depths = np.array([expose(simulation, k)[0]["tof/depth"].si() for k in range(30)])  # the first second is at rest
    distance, amplitude = head.ideal(View(simulation.scene, head.camera).look(simulation.scene.at(0.0)))
    bright = amplitude > 1000
    normalized = ((depths - distance - head.noise.mu(distance, amplitude)) / head.noise.sigma(distance, amplitude))[
        :, bright
    ]
    assert head.noise == TimeOfFlightNoise(mu_offset=0.02)
    assert np.abs(normalized.mean()) < 0.01
    assert normalized.std() == pytest.approx(1, abs=0.01)
    dark = bright & (amplitude < 2000)
    shining = amplitude > 6000
    assert depths[:, dark].std(axis=0).mean() > 2 * depths[:, shining].std(axis=0).mean()
    assert 0.0025 < depths[:, shining].std(axis=0).mean() < 0.004


def test_the_published_polynomial_fits_the_model() -> None:
    noise = TimeOfFlightNoise()
    model = GaussianPolynomial(sigma=SIGMA_POLYNOMIAL)
    x, a = np.meshgrid(np.linspace(0.6, 2.0, 8), np.linspace(2000, 10000, 50))
    pixels = (np.zeros(x.shape, int), np.zeros(x.shape, int))
    assert np.max(np.abs(model.deviation(x, a, pixels) - noise.sigma(x, a))) < 3e-4


def test_exactly_the_weak_returns_are_invalid() -> None:
    simulation = build("sensors=tof&noise=0")
    frames, _ = expose(simulation, 0)
    depth, amplitude = frames["tof/depth"], frames["tof/amplitude"].si()
    lost = np.isnan(depth.si())
    assert 0.001 < lost.mean() < 0.3
    assert np.all(amplitude[lost] <= 500)
    assert np.all(amplitude[~lost] >= 500)


def test_flying_pixels_are_between_sheet_and_wall() -> None:
    simulation = build("sensors=tof&noise=0")
    head = simulation.heads["tof"]
    assert isinstance(head, TimeOfFlight)
    (sight,) = View(simulation.scene, head.camera).look(simulation.scene.at(4.0))
    depth = expose(simulation, 120)[0]["tof/depth"].si()[sight.region]
    rim = (sight.share > 0.2) & (sight.share < 0.8) & np.isfinite(depth)
    assert rim.sum() > 50
    assert np.all(depth[rim] > sight.distance[rim] + 1e-3)
    assert np.all(depth[rim] < 1.9)


def test_the_amplitude_falls_with_the_square_of_the_distance() -> None:
    simulation = build("sensors=tof&noise=0", "board")
    frames, _ = expose(simulation, 0)
    depth, amplitude = frames["tof/depth"].si(), frames["tof/amplitude"].si()
    board = depth[62:82, 77:99] < 1.3
    assert board.all()
    rays = simulation.heads["tof"].camera.rays()
    reflectivity = (amplitude * depth**2 / rays[..., 2] / 10_000)[62:82, 77:99]
    assert np.percentile(reflectivity, 5) == pytest.approx(0.25, abs=0.01)
    assert np.percentile(reflectivity, 95) == pytest.approx(0.85, abs=0.01)


def test_infrared_is_the_returned_intensity() -> None:
    simulation = build("sensors=tof,ir&noise=0&ir=176x144")
    tof, ir = simulation.heads["tof"], simulation.heads["ir"]
    assert ir.camera.fx != tof.camera.fx
    frames, truth = expose(simulation, 150)
    assert (frames["ir/ir"].kind, frames["ir/ir"].encoding, frames["ir/ir"].unit) == (Kind.IR, "mono16", "dn")
    brightness = frames["ir/ir"].si()[at(simulation, "ir", inner(truth))]
    amplitude = frames["tof/amplitude"].si()[at(simulation, "tof", inner(truth))]
    # From 6 cm beside each other, and half a pixel off, they see the same paper.
    assert np.median(np.abs(brightness / amplitude - 1)) < 0.03
    assert np.corrcoef(brightness, amplitude)[0, 1] > 0.97


def test_infrared_noise_has_the_declared_deviation() -> None:
    simulation = build("sensors=ir&noise=2")
    images = np.array([expose(simulation, k)[0]["ir/ir"].si() for k in range(20)])
    assert np.sqrt(images.var(axis=0, ddof=1)[images.mean(axis=0) > 500].mean()) == pytest.approx(100, rel=0.02)


@pytest.mark.parametrize("lens", ["0", "-0.25,0.06"])
def test_material_points_keep_their_colour(lens: str) -> None:
    simulation = build(f"sensors=color&noise=0&color=640x480&lens={lens}")
    before, truth_before = expose(simulation, 0)
    after, truth_after = expose(simulation, 150)
    colors = [
        frames["color/color"].data[at(simulation, "color", inner(truth))].astype(float)
        for frames, truth in ((before, truth_before), (after, truth_after))
    ]
    assert np.corrcoef(colors[0].ravel(), colors[1].ravel())[0, 1] > 0.97
    assert np.std(colors[0], axis=0).min() > 30


def test_colour_noise_has_the_declared_deviation() -> None:
    simulation = build("sensors=color")
    images = np.array([expose(simulation, k)[0]["color/color"].data for k in range(20)]).astype(float)
    mid = (images.mean(axis=0) > 20) & (images.mean(axis=0) < 235)
    assert np.sqrt(images.var(axis=0, ddof=1)[mid].mean()) == pytest.approx(2.5, abs=0.05)


def test_all_heads_share_the_exposure_time_and_jitter_is_opt_in() -> None:
    exact, _ = expose(build(ALL), 7)
    assert {frame.t_host_ns for frame in exact.values()} == {round(7e9 / 30)}
    assert {frame.seq for frame in exact.values()} == {7}
    jittered, truth = expose(build(ALL + "&jitter_ms=2"), 7)
    errors = {frame.sensor: frame.t_host_ns - truth.t_host_ns for frame in jittered.values()}
    assert len(set(errors.values())) == 5
    assert all(0 < abs(error) < 10e6 for error in errors.values())
    assert {frame.t_sigma_ns for frame in jittered.values()} == {2_000_000}
