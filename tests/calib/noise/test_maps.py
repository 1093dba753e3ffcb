"""Noise of regions and pixels comes from files, goes to files, and what is wrong with a file is named."""

import zipfile

import numpy as np
import pytest

from calib.noise import pixel_polynomial, region_polynomial
from calib.noise.base import NoiseError
from calib.noise.region_polynomial import blocks
from tests.calib.noise.models import varied

X, A = np.array([0.6, 1.0, 2.5]), np.array([200.0, 3000.0, 9000.0])
P = (np.array([0, 3, 2]), np.array([4, 1, 0]))
PIXELS, REGIONS = varied()
MODULES = {"pixel": pixel_polynomial, "region": region_polynomial}


def saved(folder, model, **changes):
    """A file of a model's arrays with some exchanged, or left out where they are None."""
    arrays = {name: getattr(model, name) for name in model.__dataclass_fields__} | changes
    path = folder / "maps.npz"
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            if array is not None:
                with archive.open(f"{name}.npy", "w") as stream:
                    np.save(stream, np.asarray(array))
    return path


@pytest.mark.parametrize(("module", "model"), [(pixel_polynomial, PIXELS), (region_polynomial, REGIONS)])
def test_what_is_written_can_be_read(tmp_path, module, model):
    model.save(tmp_path / "maps.npz")
    read = module.Settings(tmp_path / "maps.npz").build()
    np.testing.assert_array_equal(read.deviation(X, A, P), model.deviation(X, A, P))
    np.testing.assert_array_equal(read.mean(X, A, P), model.mean(X, A, P))
    assert read.shape == model.shape == (4, 5)
    assert read.minimum_sigma == model.minimum_sigma


def test_a_file_that_does_not_say_its_least_deviation_has_the_usual_one(tmp_path):
    read = pixel_polynomial.Settings(saved(tmp_path, PIXELS, minimum_sigma=None)).build()
    assert read.minimum_sigma == 1e-4


@pytest.mark.parametrize(
    ("kind", "changes", "message"),
    [
        ("pixel", {"mu": None, "distances": None}, r"lacks the array\(s\) \['distances', 'mu'\]"),
        ("pixel", {"sigma": np.ones((2, 2))}, r"\(i, j, height, width\)"),
        ("pixel", {"mu": np.ones((1, 1, 9, 9))}, r"of one image size"),
        ("pixel", {"distances": np.ones(3)}, r"distances .* \[lowest, highest\]"),
        ("pixel", {"amplitudes": np.array([5.0, 1.0])}, r"amplitudes .* \[lowest, highest\]"),
        ("pixel", {"minimum_sigma": 0.0}, r"minimum_sigma .* above 0, not 0.0"),
        ("pixel", {"mu": np.array([None, {}])}, "cannot be read as .npz"),
        ("pixel", {"sigma": np.full((2, 1, 4, 5), np.nan)}, r"sigma in .*maps\.npz' must be finite numbers"),
        ("pixel", {"mu": np.full((1, 1, 4, 5), "0")}, "mu in .* must be finite numbers"),
        ("region", {"labels": None}, r"lacks the array\(s\) \['labels'\]"),
        ("region", {"sigma": np.ones((1, 1, 4, 5))}, r"\(i, j, regions\)"),
        ("region", {"mu": np.ones((1, 1, 2))}, "as many regions"),
        ("region", {"labels": np.zeros((4, 5))}, "labels .* whole numbers"),
        ("region", {"labels": np.zeros(20, int)}, r"labels .* \(height, width\)"),
        ("region", {"labels": np.full((4, 5), 6)}, "labels .* 0 to 5, .* not 6 to 6"),
        ("region", {"labels": np.full((4, 5), -1)}, "labels .* not -1 to -1"),
    ],
)
def test_bad_maps_are_named(tmp_path, kind, changes, message):
    path = saved(tmp_path, PIXELS if kind == "pixel" else REGIONS, **changes)
    with pytest.raises(NoiseError, match=message):
        MODULES[kind].Settings(path).build()


@pytest.mark.parametrize("content", [None, b"", b"no archive", b"PK\x03\x04 cut off"])
def test_a_file_that_holds_no_maps_is_named(tmp_path, content):
    path = tmp_path / "maps.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(NoiseError, match=r"maps\.npz.* cannot be read as \.npz"):
        pixel_polynomial.Settings(path).build()


def test_a_single_array_is_no_archive_of_maps(tmp_path):
    path = tmp_path / "maps.npy"
    np.save(path, np.ones(3))
    with pytest.raises(NoiseError, match=r"maps\.npy.* cannot be read as \.npz"):
        pixel_polynomial.Settings(path).build()


def test_blocks_are_squares_numbered_row_by_row():
    expected = [[0, 0, 1, 1, 2], [0, 0, 1, 1, 2], [3, 3, 4, 4, 5]]
    np.testing.assert_array_equal(blocks(3, 5, 2), expected)
