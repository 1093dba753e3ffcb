"""Simulation without a clock: exposure k is a pure function of the seed and k."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors.exposure import NOMINAL_S, Exposure, Head


@dataclass(frozen=True, eq=False)
class Simulation:
    """A scene and the heads that observe it, exposed simultaneously.

    Attributes:
        scene: the scene.
        heads: by sensor name.
        seed: random seed of all noise.
        rate_hz: exposures per second.
        jitter_ns: standard deviation of the timestamps' error [ns].
        truth_size: rows and columns of the grid of material points in a `Truth`.
        noisy: False if images may be equal, see `StreamInfo`.
    """

    scene: Scene
    heads: Mapping[str, Head]
    seed: int
    rate_hz: float
    jitter_ns: int = 0
    truth_size: tuple[int, int] = (21, 31)
    noisy: bool = True

    def time_ns(self, k: int) -> int:
        """Time of exposure `k` since exposure 0 [ns]."""
        return round(k * 1e9 / self.rate_hz)

    def expose(self, k: int) -> tuple[list[Frame], Truth]:
        """Frames of all heads at exposure `k`, and ground truth of the first surface; see `frames` and `truths`."""
        return self.frames(k), self.truths(k)[0]

    def frames(self, k: int, color_s: float = NOMINAL_S) -> list[Frame]:
        """Frames of all heads at exposure `k`, those of colour exposed for `color_s` [s]; times since exposure 0."""
        t_ns = self.time_ns(k)
        moment = self.scene.at(t_ns * 1e-9)
        frames: list[Frame] = []
        for name, head in self.heads.items():
            seeds = np.random.SeedSequence([self.seed, k, zlib.crc32(name.encode())])
            generator = np.random.Generator(np.random.SFC64(seeds))
            jitter = round(self.jitter_ns * generator.standard_normal())
            frames += head.expose(Exposure(k, moment, generator, t_ns, jitter, self.jitter_ns, color_s))
        return frames

    def truths(self, k: int) -> list[Truth]:
        """Ground truth of every surface at exposure `k`."""
        t_ns = self.time_ns(k)
        surfaces = self.scene.at(t_ns * 1e-9).surfaces
        return [Truth(k, t_ns, s.grid(*self.truth_size).astype(np.float32), i) for i, s in enumerate(surfaces)]
