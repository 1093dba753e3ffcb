"""What comes in over the isochronous pipes, whoever carries it: libusb, or a test."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.contract.device import DeviceError

#: A microframe of high-speed USB, in which each pipe carries up to one packet [ns].
MICROFRAME_NS = 125_000


class DisconnectedError(DeviceError):
    """The device was unplugged, or lost its power."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """A run of microframes of one pipe.

    Attributes:
        endpoint: address of the pipe.
        packets: (n, PACKET_BYTES) uint8, one microframe a row; valid until the next one is asked for.
        lengths: (n,) how many bytes of each row came.
        t_ns: when the last of them was there, CLOCK_MONOTONIC [ns].
    """

    endpoint: int
    packets: NDArray[np.uint8]
    lengths: NDArray[np.uint32]
    t_ns: int

    def arrival_ns(self, row: int) -> int:
        """When the packet of a row was there; rows before the first (negative ones) were in earlier transfers [ns]."""
        return self.t_ns - (len(self.packets) - 1 - row) * MICROFRAME_NS


class Reader(Protocol):
    """Streams of a device. One thread uses it."""

    def read(self, timeout_s: float) -> Iterator[Transfer]:
        """Waits for transfers; those of a pipe come in their order.

        Args:
            timeout_s: the longest to wait for the first one [s].

        Raises:
            DisconnectedError: there will be no more.
            DeviceError: the host does not go on.
        """
        ...

    def close(self) -> None:
        """Ends all transfers; may be called again."""
        ...
