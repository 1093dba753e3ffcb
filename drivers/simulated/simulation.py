"""The simulated world without a clock: exposure k is a pure function of the seed and k."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from drivers.contract.device import Truth
from drivers.contract.frame import Frame
from drivers.simulated.scene.scene import Scene
from drivers.simulated.sensors.exposure import Exposure, Head


@dataclass(frozen=True, eq=False)
class Simulation:
    """A scene and the heads that look at it, all exposed at the same instants.

    Attributes:
        scene: what moves.
        heads: who looks, by sensor name.
        seed: of all noise.
        rate_hz: exposures per second.
        jitter_ns: standard deviation of the error of the frames' stamps [ns].
        truth_size: rows and columns of the material points in a `Truth`.
    """

    scene: Scene
    heads: Mapping[str, Head]
    seed: int
    rate_hz: float
    jitter_ns: int = 0
    truth_size: tuple[int, int] = (21, 31)

    def time_ns(self, k: int) -> int:
        """When exposure `k` happens [ns after exposure 0]."""
        return round(k * 1e9 / self.rate_hz)

    def expose(self, k: int) -> tuple[list[Frame], Truth]:
        """The frames of all heads at exposure `k`, and the truth about the first surface; see `frames` and `truths`."""
        return self.frames(k), self.truths(k)[0]

    def frames(self, k: int) -> list[Frame]:
        """The frames of all heads at exposure `k`; times count from exposure 0."""
        t_ns = self.time_ns(k)
        moment = self.scene.at(t_ns * 1e-9)
        frames: list[Frame] = []
        for name, head in self.heads.items():
            seeds = np.random.SeedSequence([self.seed, k, zlib.crc32(name.encode())])
            generator = np.random.Generator(np.random.SFC64(seeds))
            jitter = round(self.jitter_ns * generator.standard_normal())
            frames += head.expose(Exposure(k, moment, generator, t_ns, jitter, self.jitter_ns))
        return frames

    def truths(self, k: int) -> list[Truth]:
        """The truth about every surface at exposure `k`."""
        t_ns = self.time_ns(k)
        surfaces = self.scene.at(t_ns * 1e-9).surfaces
        return [Truth(k, t_ns, s.grid(*self.truth_size).astype(np.float32), i) for i, s in enumerate(surfaces)]
