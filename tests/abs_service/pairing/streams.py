"""Streams of a depth camera and a colour camera, and what pairs them."""

import numpy as np

from abs_service.pairing.synchroniser import Synchroniser
from drivers.contract.frame import Frame, Geometry, Kind

MS = 1_000_000
TOF, COLOR, AMPLITUDE = ("tof", "depth"), ("color", "color"), ("tof", "amplitude")
TOLERANCE = 12 * MS


def frame(key, t_ms, seq=None, *, epoch=0, size=(2, 3), late_ms=0.0):
    """An image of a stream, which arrives late."""
    t_ns = int(t_ms * MS)
    kind, encoding = (Kind.DEPTH, "16UC1") if key == TOF else (Kind.AMPLITUDE, "16UC1")
    return Frame(
        sensor=key[0],
        stream=key[1],
        kind=kind,
        data=np.zeros(size, "<u2"),
        encoding=encoding,
        geometry=Geometry.RADIAL if kind == Kind.DEPTH else Geometry.NONE,
        t_host_ns=t_ns,
        t_arrival_ns=t_ns + int(late_ms * MS),
        seq=int(t_ms) if seq is None else seq,
        epoch=epoch,
    )


def synchroniser(*members, **settings):
    """Pairs depth with these streams, or with colour."""
    return Synchroniser(TOF, [TOF, *(members or [COLOR])], TOLERANCE, **settings)
