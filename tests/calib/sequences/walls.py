"""Static sequences of the simulator's heads before a wall, whose laws of errors share no code with the noise models."""

from typing import Any

import numpy as np

from calib.sequences.static import Static, reduce
from drivers.contract.frame import Frame, Geometry, Kind
from drivers.simulated.address import parse


def frames(uri: str, first: int, last: int) -> tuple[list[Frame], Any]:
    """Some exposures of the only head of an address, and the head."""
    simulation = parse(uri).build()
    (head,) = simulation.heads.values()
    return [frame for k in range(first, last) for frame in simulation.frames(k)], head


def sequence(uri: str, first: int = 0, last: int = 30, keep: int = 30) -> tuple[Static, Any]:
    """Some exposures, reduced, and the head that took them."""
    taken, head = frames(uri, first, last)
    depth = [frame for frame in taken if frame.kind is Kind.DEPTH]
    lengths = np.stack([frame.si() for frame in depth])
    bright = [frame.si() for frame in taken if frame.kind is Kind.AMPLITUDE]
    amplitude = np.stack(bright) if bright else np.full_like(lengths, np.nan)
    rays = head.camera.rays()
    along = np.ones(rays.shape[:2]) if depth[0].geometry == Geometry.RADIAL else 1 / rays[..., 2]
    return reduce(uri, lengths, amplitude, rays, along, depth[0].scale, keep), head
