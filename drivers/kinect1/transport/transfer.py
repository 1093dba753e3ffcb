"""Interface of isochronous transfers, implemented by libusb and by tests."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.contract.device import DeviceError

#: Microframe of high-speed USB, with up to one packet per endpoint [ns].
MICROFRAME_NS = 125_000


class DisconnectedError(DeviceError):
    """The device was unplugged or lost power."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """Consecutive microframes of one endpoint.

    Attributes:
        endpoint: endpoint address.
        packets: (n, PACKET_BYTES) uint8, one microframe per row; valid until the next transfer is read.
        lengths: (n,) number of valid bytes per row.
        t_ns: arrival of the last packet, CLOCK_MONOTONIC [ns].
    """

    endpoint: int
    packets: NDArray[np.uint8]
    lengths: NDArray[np.uint32]
    t_ns: int

    def arrival_ns(self, row: int) -> int:
        """Arrival time of a row's packet [ns]; negative rows are in earlier transfers."""
        return self.t_ns - (len(self.packets) - 1 - row) * MICROFRAME_NS


class Reader(Protocol):
    """Reader of a device's streams, for one thread."""

    def read(self, timeout_s: float) -> Iterator[Transfer]:
        """Waits for transfers; those of one endpoint are in order.

        Args:
            timeout_s: timeout for the first one [s].

        Raises:
            DisconnectedError: no more transfers.
            DeviceError: the host reports failures.
        """
        ...

    def close(self) -> None:
        """Cancels all transfers; idempotent."""
        ...
