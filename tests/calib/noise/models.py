"""One depth noise model of every type, with μ and σ that depend on all they can, and Hypothesis strategies for more."""

import numpy as np
from hypothesis import strategies as st

from calib.noise.base import DepthNoise
from calib.noise.constant import Constant
from calib.noise.gaussian_polynomial import GaussianPolynomial
from calib.noise.measured import Measured
from calib.noise.per_pixel import PerPixel
from calib.noise.pixel_polynomial import PixelPolynomial
from calib.noise.region_polynomial import RegionPolynomial, blocks
from calib.noise.structured_light import StructuredLight
from calib.noise.tof_amplitude import TofAmplitude

HEIGHT, WIDTH = 4, 5
DISTANCES, AMPLITUDES = (0.5, 3.0), (100.0, 10_000.0)
SIGMA = ((2e-3, -1e-7), (5e-4, 0.0), (1e-4, 0.0))
MU = ((0.01, 1e-6), (-2e-3, 0.0))
GLOBAL = GaussianPolynomial(SIGMA, MU, DISTANCES, AMPLITUDES)
TOF = TofAmplitude((1.5e-3, 5e-4), 9.0, (0.01, -2e-3), -6.0, DISTANCES, AMPLITUDES)


def repeated(table: tuple[tuple[float, ...], ...], *shape: int) -> np.ndarray:
    """The same coefficients (i, j, *shape) at every place."""
    return np.tile(np.array(table).reshape(len(table), len(table[0]), *(1 for _ in shape)), (1, 1, *shape))


def pixel_maps(sigma=SIGMA, mu=MU) -> PixelPolynomial:
    """The model `GLOBAL` with equal coefficients for every pixel."""
    maps = repeated(sigma, HEIGHT, WIDTH), repeated(mu, HEIGHT, WIDTH)
    return PixelPolynomial(*maps, np.array(DISTANCES), np.array(AMPLITUDES))


def region_tables(sigma=SIGMA, mu=MU, side: int = 2) -> RegionPolynomial:
    """The model `GLOBAL` with equal coefficients for every region; regions are squares."""
    labels = blocks(HEIGHT, WIDTH, side)
    regions = int(labels.max()) + 1
    tables = repeated(sigma, regions), repeated(mu, regions)
    return RegionPolynomial(labels, *tables, np.array(DISTANCES), np.array(AMPLITUDES))


def varied(seed: int = 3) -> tuple[PixelPolynomial, RegionPolynomial]:
    """Maps and tables whose coefficients differ from place to place."""
    factor = np.random.default_rng(seed).uniform(0.7, 1.5, (2, HEIGHT, WIDTH))
    maps, tables = pixel_maps(), region_tables()
    regions = tables.sigma.shape[2]
    return (
        PixelPolynomial(maps.sigma * factor[0], maps.mu * factor[1], maps.distances, maps.amplitudes),
        RegionPolynomial(
            *(tables.labels, tables.sigma * factor[0].ravel()[:regions], tables.mu * factor[1].ravel()[:regions]),
            *(tables.distances, tables.amplitudes),
        ),
    )


def own_of_pixels(seed: int = 4) -> PerPixel:
    """The law `TOF`, with pixels that differ."""
    generator = np.random.default_rng(seed)
    offset = 3e-3 * generator.standard_normal((2, HEIGHT, WIDTH))
    return PerPixel(TOF, offset, generator.uniform(0.7, 1.5, (HEIGHT, WIDTH)), np.array(DISTANCES))


MODELS: dict[str, DepthNoise] = {
    "constant": Constant(4e-3, -0.02),
    "gaussian_polynomial": GLOBAL,
    "measured": Measured(5.0, 1e-3),
    "region_polynomial": varied()[1],
    "pixel_polynomial": varied()[0],
    "per_pixel": own_of_pixels(),
    "structured_light": StructuredLight(floor=5e-4),
    "tof_amplitude": TOF,
}

#: A deviation that a sensor may have [m].
SIGMAS = st.floats(2e-4, 0.03)
#: Relative changes of the deviation over the whole domain, for several places.
CHANGES = st.lists(st.floats(-0.8, 3.0), min_size=2, max_size=2)


@st.composite
def polynomials(draw: st.DrawFn) -> GaussianPolynomial:
    """Polynomials of degree one in the amplitude and up to three in the distance, positive in the domain."""
    sigma, (by_x, by_a) = draw(SIGMAS), draw(CHANGES)
    power = draw(st.integers(1, 3))
    table = np.zeros((4, 2))
    table[0, 0] = sigma
    table[power, 0] = sigma * by_x / DISTANCES[1] ** power / 2
    table[0, 1] = sigma * by_a / AMPLITUDES[1] / 2
    mu = tuple(draw(st.tuples(st.floats(-0.1, 0.1), st.floats(-1e-6, 1e-6))) for _ in range(2))
    return GaussianPolynomial(tuple(map(tuple, table.tolist())), mu, DISTANCES, AMPLITUDES)


@st.composite
def maps(draw: st.DrawFn) -> PixelPolynomial | RegionPolynomial:
    """A polynomial times a factor of its own for every region or pixel."""
    image = draw(polynomials())
    kind = draw(st.sampled_from([pixel_maps, region_tables]))
    made = kind(image.sigma, image.mu)
    places = made.sigma.shape[2:]
    factors = np.random.default_rng(draw(st.integers(0, 99))).uniform(0.5, 2, places)
    made.sigma[...] *= factors
    made.mu[...] *= factors
    return made


def any_model() -> st.SearchStrategy[DepthNoise]:
    """Noise models of every type."""
    return st.one_of(
        st.builds(Constant, SIGMAS, st.floats(-0.2, 0.2)),
        polynomials(),
        maps(),
        st.builds(Measured, factor=st.floats(1e-7, 1e-6), floor=SIGMAS),  # the strategies' amplitudes are no metres
        st.builds(StructuredLight, noise=st.floats(3e-4, 5e-3), step=st.floats(0, 5e-3), floor=st.floats(0, 5e-3)),
        st.builds(
            TofAmplitude,
            sigma=st.tuples(SIGMAS, st.floats(0, 3e-3)),
            sigma_amplitude=st.floats(0, 20),
            mu=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.01, 0.01)),
            mu_amplitude=st.floats(-20, 20),
            distances=st.just(DISTANCES),
            amplitudes=st.just(AMPLITUDES),
        ),
    )
