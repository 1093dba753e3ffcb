"""Cables with delay and loss, for kernels without tc-netem(8): a process that carries the packets, by TAP devices.

    python slow_cables.py DELAY_S LOSS HOST…

For each host, makes the interfaces HOST and HOST-1 and carries every packet that enters one of them to the other: in
order, after the delay, but for the share that is lost. It ends, and the interfaces with it, when its standard input
does. It runs as a file of its own, so that it starts at once.
"""

import fcntl
import math
import os
import random
import select
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress

#: linux/if_tun.h: sets name and kind of an interface; Ethernet, without a header of its own.
_TUNSETIFF, _TAP = 0x400454CA, 0x1002
#: More than any packet, since the kernel joins none for an interface that cannot cut them.
_MAX_BYTES = 4096
#: The same packets are lost in every run, as far as the same are sent.
_SEED = 1


@contextmanager
def laid(hosts: Sequence[str], delay_s: float, loss: float) -> Iterator[str]:
    """Starts the process; gives the reason for which it cannot be, "" if it runs.

    Args:
        hosts: names, of 13 letters at most.
        delay_s: of each packet, in each direction [s].
        loss: share of the packets that are lost, in each direction.
    """
    command = [sys.executable, __file__, str(delay_s), str(loss), *hosts]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield process.stdout.readline().strip() if process.stdout else ""
    finally:
        process.communicate()


def carry(across: Mapping[int, int], delay_s: float, loss: float, stop: int) -> None:
    """Carries packets between open interfaces until `stop`, a descriptor, can be read.

    Args:
        across: the other end of each interface.
        delay_s, loss: see `laid`.
        stop: a descriptor.
    """
    chance, poll = random.Random(_SEED), select.poll()
    for one in (*across, stop):
        poll.register(one, select.POLLIN)
    under_way: deque[tuple[float, int, bytes]] = deque()
    while True:
        wait_ms = math.ceil(max(0.0, under_way[0][0] - time.monotonic()) * 1e3) if under_way else None
        ready = [one for one, _ in poll.poll(wait_ms)]
        if stop in ready:
            return
        for one in ready:
            # One that is down says so; that is a cut.
            with suppress(OSError):
                packet = os.read(one, _MAX_BYTES)
                if chance.random() >= loss:
                    under_way.append((time.monotonic() + delay_s, across[one], packet))
        while under_way and under_way[0][0] <= time.monotonic():
            _, other, packet = under_way.popleft()
            with suppress(OSError):
                os.write(other, packet)


def _interface(name: str) -> int:
    opened = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(opened, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _TAP))
    return opened


def _main(delay_s: str, loss: str, *hosts: str) -> None:
    across: dict[int, int] = {}
    try:
        for host in hosts:
            one, other = _interface(host), _interface(f"{host}-1")
            across |= {one: other, other: one}
    except OSError as error:
        print(f"/dev/net/tun: {error.strerror}", flush=True)
        return
    print(flush=True)
    carry(across, float(delay_s), float(loss), sys.stdin.fileno())


if __name__ == "__main__":
    _main(*sys.argv[1:])
