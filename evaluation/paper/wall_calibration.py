"""The paper's noise calibration (5.1) on simulated walls: five distances of three materials, the truth known."""

import numpy as np

from calib.noise import tof_amplitude
from calib.noise.fit.samples import Samples, from_images, joined
from calib.noise.tof_amplitude import TofAmplitude
from drivers.contract.frame import Kind
from drivers.simulated.address import parse
from drivers.simulated.sensors.view import View
from drivers.simulated.simulation import Simulation

#: Distances [m] of the walls, and their reflectivities.
DISTANCES, MATERIALS = (0.7, 0.85, 1.0, 1.15, 1.3), (0.85, 0.4, 0.15)


def calibrated_noise(sensor: str, frames: int, seed: int) -> TofAmplitude:
    """Noise model of a time-of-flight sensor, fitted to static sequences of walls.

    Args:
        sensor: keys of the simulated device's address for the sensor's errors, such as "dark=-40".
        frames: of each of the 15 sequences.
        seed: of their noise.
    """
    parts = []
    for place, distance in enumerate(DISTANCES):
        for number, material in enumerate(MATERIALS):
            wall = f"distance={distance}&reflectivity={material}&seed={1000 * seed + 10 * place + number}"
            parts.append(_samples(parse(f"simulated://wall?sensors=tof&{wall}&{sensor}").build(), frames))
    return tof_amplitude.fit(joined(parts))


def _samples(walls: Simulation, frames: int) -> Samples:
    """Samples of all pixels of a static wall, with the true distances."""
    images = [{frame.kind: frame.si() for frame in walls.frames(k)} for k in range(frames)]
    measured, amplitude = (np.stack([image[kind] for image in images]) for kind in (Kind.DEPTH, Kind.AMPLITUDE))
    return from_images(measured, View(walls.scene, walls.heads["tof"].camera).wall.distance, amplitude)
