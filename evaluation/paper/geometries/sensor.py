"""The camera of E1 with its true errors, and its calibration (section 5.1 of the paper)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.noise import gaussian_polynomial, per_pixel, tof_amplitude
from calib.noise.fit.samples import Samples, from_images
from calib.noise.fit.shrinkage import Repeats
from calib.noise.per_pixel import PerPixel
from calib.noise.region_polynomial import blocks
from calib.sequences.evidence import Evidence, thinned, together
from evaluation.scenes.rendering import Renderer
from evaluation.scenes.surfaces import Wall
from evaluation.scenes.time_of_flight import SR4000, TimeOfFlight

#: Distances of the static sequences [m], as in the paper's figure 8, and reflectivities of the materials.
DISTANCES, MATERIALS = (0.753, 1.185, 1.606, 2.193, 2.652), (0.9, 0.5, 0.17)

#: Share of the light of the centre that the lamp sends to the corners of the image.
CORNER = 0.3

#: Frames of a sequence whose single measurements tell the law of the image, and how many of all of these.
FEW, MAX_SAMPLES = 2, 20_000

#: Sides of the regions [px] by which the image differs from its law.
REGION_PX = 8

#: Deviation of the logarithm of the pixels' own factors on the deviation.
SCATTER = 0.3

#: Calibrations by name: a law of the truth's form without mean offsets of the pixels; with them; polynomials in
#: distance and amplitude as law, the paper's form and not the truth's, without offsets; and with them.
PLAIN, OFFSETS, POLYNOMIAL, BOTH = "plain", "offsets", "polynomial", "both"

#: Degrees of the polynomials of σ and of μ in distance and amplitude.
DEGREES = (1, 3)


def true_sensor(generator: np.random.Generator) -> TimeOfFlight:
    """A camera whose light falls off to the corners, and whose pixels differ; it has no mean offset."""
    v, u = np.indices((SR4000.height, SR4000.width))
    radius = np.hypot((u - SR4000.cx) / SR4000.cx, (v - SR4000.cy) / SR4000.cy) / np.sqrt(2)
    factor = np.exp(SCATTER * generator.standard_normal(radius.shape))
    return TimeOfFlight(factor, illumination=1 - (1 - CORNER) * radius**2)


def calibrated(sensor: TimeOfFlight, frames: int, generator: np.random.Generator) -> Mapping[str, PerPixel]:
    """Noise models of a camera by name, fitted to static sequences of walls: a law, and maps of the pixels.

    The form of `PLAIN` is the one that `abs-service calibrate noise` selects for such a sensor, fitted by the same
    functions. Mean offsets of the pixels are left out of it: the sensor has none, so they are noise of the calibration.

    Args:
        sensor: the camera.
        frames: of every sequence.
        generator: draws the noise.
    """
    walls = [(depth, material) for depth in DISTANCES for material in MATERIALS]
    found = together([_static(sensor, Wall(depth, material), frames, generator) for depth, material in walls])
    few, labels = thinned(found.samples, MAX_SAMPLES, generator), blocks(SR4000.height, SR4000.width, REGION_PX)
    true_form, polynomial = (
        per_pixel.fit(found.means, law, labels, repeats=found.repeats)
        for law in (tof_amplitude.fit(few), gaussian_polynomial.fit(few, DEGREES, DEGREES))
    )
    return {
        PLAIN: _without_offsets(true_form),
        OFFSETS: true_form,
        POLYNOMIAL: _without_offsets(polynomial),
        BOTH: polynomial,
    }


def _without_offsets(model: PerPixel) -> PerPixel:
    return replace(model, offset=np.zeros_like(model.offset))


def _static(sensor: TimeOfFlight, wall: Wall, frames: int, generator: np.random.Generator) -> Evidence:
    """Evidence of a static sequence of a wall; single measurements are those of the first frames."""
    view = Renderer(SR4000, wall).render()
    measured = [sensor.measure(view, generator) for _ in range(frames)]
    distance, amplitude = (
        np.stack(part).astype(float) for part in zip(*((one.distance, one.amplitude) for one in measured))
    )
    times = np.isfinite(distance).sum(axis=0)
    some = times > 1
    mean = np.nanmean(distance[:, some], axis=0)
    variance = np.nanmean((distance[:, some] - mean) ** 2, axis=0)
    rows, columns = np.nonzero(some)
    return Evidence(
        samples=from_images(distance[:FEW], view.distance, amplitude[:FEW]).returns(with_amplitude=True),
        means=Samples(mean, view.distance[some], amplitude.mean(axis=0)[some], rows, columns),
        repeats=Repeats(times[some].astype(float), variance),
    )
