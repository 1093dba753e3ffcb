"""Isochronous transfers in flight on the libusb handle of a pyusb device.

pyusb itself has one transfer in flight and loses a third of the packets between transfers. This module uses pyusb's
private library and handle, so its version is pinned.
"""

import ctypes
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import usb.backend.libusb1 as libusb
import usb.core
from numpy.typing import NDArray

from drivers.contract.device import DeviceError
from drivers.kinect1.transport.packets import PACKET_BYTES
from drivers.kinect1.transport.transfer import DisconnectedError, Transfer

#: Transfers in flight per endpoint, and microframes in each: they buffer 128 ms. Both endpoints take 4 MB of the 16 MB
#: that Linux grants to usbfs by default.
TRANSFERS, MICROFRAMES = 16, 64

#: Maximum number of consecutive failed transfers: one second of them.
MAX_FAILURES = 125

_COMPLETED, _NO_DEVICE = 0, 5
_ERROR_NO_DEVICE = -4

#: Timeout of cancellation [s].
_CANCEL_S = 2.0

#: Rings with transfers that were not returned: the kernel may still write into their memory, so it is kept.
_leaked: list["IsochronousRing"] = []


class _Time(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("microseconds", ctypes.c_long))


@dataclass(frozen=True, eq=False)
class _Slot:
    """One transfer: libusb's structure, its buffer, and length, actual length and status of each packet."""

    endpoint: int
    transfer: Any
    packets: NDArray[np.uint8]
    results: NDArray[np.uint32]


class IsochronousRing:
    """A `Reader` of a pyusb device on libusb.

    A completed transfer is resubmitted as soon as it was read. The completion callback may run in any thread that uses
    the same libusb context, so it only puts the transfer into a queue.

    Args:
        device: opened, with its interface claimed.
        endpoints: endpoint addresses.
        clock: CLOCK_MONOTONIC [ns].

    Raises:
        DeviceError: insufficient USB bandwidth.
    """

    def __init__(self, device: usb.core.Device, endpoints: Sequence[int], clock: Callable[[], int]) -> None:
        context: Any = device._ctx  # noqa: SLF001
        self._library, self._context = context.backend.lib, context.backend.ctx
        self._declare()
        self._clock = clock
        self._completed: deque[tuple[int, int]] = deque()  # address of the transfer, time
        self._callback = libusb._libusb_transfer_cb_fn_p(self._complete)  # noqa: SLF001
        self._failures = 0
        slots = [self._slot(context.handle.handle, endpoint) for endpoint in endpoints for _ in range(TRANSFERS)]
        self._slots = {ctypes.addressof(slot.transfer.contents): slot for slot in slots}
        self._flying: set[int] = set()
        try:
            for address in self._slots:
                self._submit(address)
        except DeviceError:
            self.close()
            raise

    def read(self, timeout_s: float) -> Iterator[Transfer]:
        """See `drivers.kinect1.transport.transfer.Reader`."""
        if not self._completed:
            self._handle_events(timeout_s)
        while self._completed:
            address, t_ns = self._completed.popleft()
            self._flying.discard(address)
            slot = self._slots[address]
            status = slot.transfer.contents.status
            if status == _NO_DEVICE:
                raise DisconnectedError("the camera was unplugged")
            self._failures = 0 if status == _COMPLETED else self._failures + 1
            if self._failures > MAX_FAILURES:
                raise DeviceError(f"the host reports every transfer as failed, the last with libusb status {status}")
            if status == _COMPLETED:
                lengths = np.where(slot.results[:, 2] == _COMPLETED, slot.results[:, 1], 0).astype(np.uint32)
                yield Transfer(slot.endpoint, slot.packets, lengths, t_ns)
            self._submit(address)

    def close(self) -> None:
        """Cancels the transfers in flight, waits for them and frees them."""
        for address in self._flying:
            self._library.libusb_cancel_transfer(self._slots[address].transfer)
        deadline_ns = self._clock() + round(_CANCEL_S * 1e9)
        while self._flying and self._clock() < deadline_ns:
            self._handle_events(0.05)
            while self._completed:
                self._flying.discard(self._completed.popleft()[0])
        if self._flying:
            _leaked.append(self)
            return
        for slot in self._slots.values():
            self._library.libusb_free_transfer(slot.transfer)
        self._slots = {}
        self._callback = None  # break the reference cycle

    def _slot(self, handle: Any, endpoint: int) -> _Slot:
        packets = np.zeros((MICROFRAMES, PACKET_BYTES), np.uint8)
        transfer = self._library.libusb_alloc_transfer(MICROFRAMES)
        memory = packets.ctypes.data_as(ctypes.POINTER(ctypes.c_ubyte))
        self._library.libusb_fill_iso_transfer(
            transfer, handle, endpoint, memory, packets.nbytes, MICROFRAMES, self._callback, None, 0
        )
        self._library.libusb_set_iso_packet_lengths(transfer, PACKET_BYTES)
        first = ctypes.addressof(transfer.contents.iso_packet_desc)
        results = np.ctypeslib.as_array((ctypes.c_uint32 * (3 * MICROFRAMES)).from_address(first))
        return _Slot(endpoint, transfer, packets, results.reshape(MICROFRAMES, 3))

    def _submit(self, address: int) -> None:
        code = self._library.libusb_submit_transfer(self._slots[address].transfer)
        if code == _ERROR_NO_DEVICE:
            raise DisconnectedError("the camera was unplugged")
        if code != 0:
            raise DeviceError(
                f"the host takes no more transfers (libusb error {code}): a Kinect needs most of a USB 2 bus, "
                "so attach it to a controller of its own"
            )
        self._flying.add(address)

    def _complete(self, transfer: Any) -> None:
        self._completed.append((ctypes.addressof(transfer.contents), self._clock()))

    def _handle_events(self, timeout_s: float) -> None:
        time = _Time(int(timeout_s), round(timeout_s % 1 * 1e6))
        self._library.libusb_handle_events_timeout_completed(self._context, ctypes.byref(time), None)

    def _declare(self) -> None:
        self._library.libusb_cancel_transfer.argtypes = [ctypes.c_void_p]
        self._library.libusb_handle_events_timeout_completed.argtypes = [ctypes.c_void_p] * 3
