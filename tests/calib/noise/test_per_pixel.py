"""A law of the image with maps of how pixels differ: found again, from single measurements or from means of many."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from abs_service.config import plugins
from abs_service.config.problems import ProblemsError
from calib.noise import per_pixel, tof_amplitude
from calib.noise.base import NoiseError
from calib.noise.fit.quality import goodness_of_fit
from calib.noise.fit.samples import Samples
from calib.noise.fit.shrinkage import Repeats
from calib.noise.images.color import GaussianColor
from calib.noise.region_polynomial import blocks
from calib.noise.tof_amplitude import TofAmplitude
from tests.calib.noise.models import DISTANCES, HEIGHT, WIDTH, own_of_pixels
from tests.calib.noise.test_shrinkage import Head

SHAPE = (18, 24)
LABELS = blocks(*SHAPE, 6)


@pytest.fixture(scope="module")
def head() -> Head:
    return Head(1)


@pytest.fixture(scope="module")
def known(head: Head) -> Samples:
    return head.boards(1, 8)


def errors(model, head: Head, samples: Samples) -> tuple[float, float]:
    """Root mean square errors of the mean offset [m], and of the deviation as a share of it."""
    x, a, p = samples.true, samples.amplitude, samples.pixels
    offset = model.mean(x, a, p) - head.mean(x, p)
    return np.sqrt(np.mean(offset**2)), np.sqrt(np.mean((model.deviation(x, a, p) / head.sigma(x, a, p) - 1) ** 2))


def averaged(samples: Samples) -> tuple[Samples, Repeats]:
    """Means of the measurements of one pixel at one distance and of one brightness."""
    white = np.rint(samples.amplitude * samples.true**2 / 1500)
    key = np.unique(np.column_stack([samples.true, white, samples.row, samples.column]), axis=0, return_inverse=True)[
        1
    ].ravel()
    count = np.bincount(key).astype(float)
    values = {f.name: np.bincount(key, getattr(samples, f.name)) / count for f in dataclasses.fields(Samples)}
    square = np.bincount(key, (samples.measured - values["measured"][key]) ** 2) / count
    rows, columns = (np.rint(values[name]).astype(int) for name in ("row", "column"))
    means = Samples(values["measured"], values["true"], values["amplitude"], rows, columns)
    return means, Repeats(count, square)


def test_pixels_are_found_again_and_explain_what_no_law_of_the_image_does(head: Head, known: Samples) -> None:
    law = tof_amplitude.fit(known)
    pixels, regions = per_pixel.fit(known, law, LABELS), per_pixel.fit_regions(known, law, LABELS)
    unseen = head.boards(7, 2)
    offsets, sigmas = zip(*(errors(model, head, unseen) for model in (law, regions, pixels)))
    assert offsets[0] > 2 * offsets[2]
    assert offsets[2] < 0.8e-3
    assert sigmas[2] < 0.14 < sigmas[0]
    likelihoods = [goodness_of_fit(model, unseen).log_likelihood for model in (law, regions, pixels)]
    assert sorted(likelihoods) == likelihoods


def test_means_of_many_measurements_tell_what_the_measurements_do(head: Head) -> None:
    known = head.boards(2, 12, outliers=0.0)
    law = tof_amplitude.fit(known)
    single = per_pixel.fit(known, law, LABELS)
    means, repeats = averaged(known)
    assert len(means) < len(known) / 5
    several = per_pixel.fit(means, law, LABELS, repeats=repeats)
    np.testing.assert_allclose(several.factor, single.factor, rtol=0.06)
    np.testing.assert_allclose(several.offset, single.offset, atol=4e-4)


def test_a_pixel_without_samples_is_like_its_region(known: Samples) -> None:
    elsewhere = known.take((known.row != 3) | (known.column != 4))
    law = tof_amplitude.fit(elsewhere)
    pixels, regions = per_pixel.fit(elsewhere, law, LABELS), per_pixel.fit_regions(elsewhere, law, LABELS)
    assert pixels.factor[3, 4] == pytest.approx(regions.factor[3, 4], rel=1e-9)
    np.testing.assert_allclose(pixels.offset[:, 3, 4], regions.offset[:, 3, 4], atol=1e-9)


def test_missing_returns_among_the_samples_change_nothing(head: Head) -> None:
    means, repeats = averaged(head.boards(3, 4, outliers=0.0))
    law, missing = tof_amplitude.fit(means), np.arange(len(means)) % 7 == 0
    seen, times = means.take(~missing), Repeats(*(one[~missing] for one in repeats))
    gone = dataclasses.replace(means, measured=np.where(missing, np.nan, means.measured))
    for fit in (per_pixel.fit, per_pixel.fit_regions):
        found, wanted = fit(gone, law, LABELS, repeats=repeats), fit(seen, law, LABELS, repeats=times)
        np.testing.assert_array_equal(found.offset, wanted.offset)
        np.testing.assert_array_equal(found.factor, wanted.factor)


def test_outside_the_domain_everything_keeps_its_edge_value() -> None:
    model, p = own_of_pixels(), (np.array([2]), np.array([3]))
    a = np.array([500.0])
    for inside, outside in zip(DISTANCES, (1e-3, 50.0)):
        x, beyond = np.array([inside]), np.array([outside])
        assert model.mean(beyond, a, p) == pytest.approx(model.mean(x, a, p))
        assert model.deviation(beyond, a, p) == pytest.approx(model.deviation(x, a, p))


def test_what_is_saved_is_what_a_rig_file_loads(tmp_path: Path) -> None:
    model = own_of_pixels()
    assert isinstance(model.model, TofAmplitude)
    model.save(tmp_path / "own.npz")
    table = {"type": "per_pixel", "file": "own.npz", "model": plugins.table(model.model)}
    read = plugins.load("calib.noise", table, tmp_path).build()
    p = np.indices((HEIGHT, WIDTH)).reshape(2, -1)
    x, a = np.linspace(0.3, 4, p.shape[1]), np.geomspace(50, 20_000, p.shape[1])
    np.testing.assert_array_equal(read.mean(x, a, (p[0], p[1])), model.mean(x, a, (p[0], p[1])))
    np.testing.assert_array_equal(read.deviation(x, a, (p[0], p[1])), model.deviation(x, a, (p[0], p[1])))
    assert read.shape == (HEIGHT, WIDTH)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"factor": np.ones((3, 3))}, "of one size"),
        ({"factor": np.zeros((HEIGHT, WIDTH))}, "factor .* above 0"),
        ({"offset": np.full((1, HEIGHT, WIDTH), np.inf)}, "offset .* finite numbers"),
        ({"distances": np.array([2.0, 1.0])}, r"distances .* \[lowest, highest\]"),
    ],
)
def test_maps_that_are_none_are_named(tmp_path: Path, changes: dict, message: str) -> None:
    dataclasses.replace(own_of_pixels(), **changes).save(tmp_path / "own.npz")
    with pytest.raises(NoiseError, match=message):
        per_pixel.Settings(tmp_path / "own.npz", TofAmplitude((1e-3,), 1.0)).build()


def test_the_law_must_be_one_of_depth(tmp_path: Path) -> None:
    own_of_pixels().save(tmp_path / "own.npz")
    with pytest.raises(NoiseError, match="model must be a noise model of depth"):
        per_pixel.Settings(tmp_path / "own.npz", GaussianColor()).build()
    with pytest.raises(ProblemsError, match=r'model\.type = "color": no such type, allowed: constant'):
        plugins.load("calib.noise", {"type": "per_pixel", "file": "own.npz", "model": {"type": "color"}}, tmp_path)
    with pytest.raises(ProblemsError):
        plugins.load("calib.noise", {"type": "per_pixel", "file": "own.npz"}, tmp_path)
