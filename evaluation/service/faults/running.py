"""A rig that runs, is listened to and records to a folder of its own."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any, Protocol

import tomli_w
from absmsg.v1.frame_info_pb2 import FrameInfo

from abs_service.bus import keys
from abs_service.recording.recovery import RecoveryError, leftovers, recover
from evaluation.experiment import UnavailableError
from evaluation.service.faults.listener import DEPTH, Listener
from evaluation.service.live.rig import TRACKER, demo_table, endpoint_of
from evaluation.service.live.service import Service
from evaluation.service.messages import recorded_messages

NAME = "faults"
#: The first start on a machine compiles the kernels [s].
START_S = 180.0
#: A process without health for this long is killed; the default of ten seconds only takes longer [s].
STALL_S = 4.0
#: Those of `abs-service run` that report their health.
COMPONENTS = frozenset({"run", "capture", f"track/{TRACKER}", "record"})


class Processes(Protocol):
    """The processes of a rig; `Service` is one."""

    def processes(self) -> Mapping[str, int]:
        """Numbers of the processes that run, by the command of each."""
        ...

    def check(self) -> None:
        """Raises a `ServiceError` if the whole has ended."""
        ...

    def stop(self, timeout_s: float = 15.0, number: signal.Signals = signal.SIGINT) -> int:
        """Asks them to end by a signal; returns the exit code."""
        ...


class RunningRig:
    """A rig and a listener of it; a context manager that ends both.

    Args:
        folder: an empty folder, with `takes` in it where that is a file system of its own.
        table: the configuration.
        start: starts the processes of the rig of a file.
        components: those whose health is listened to.

    Attributes:
        takes: folder of the recordings.
        path: file of the rig.
        endpoint: of the bus.
        service: the processes.
        listener: notes what they publish.
    """

    def __init__(
        self, folder: Path, table: Mapping[str, Any], start: Callable[[Path], Processes], components: frozenset[str]
    ) -> None:
        self.path, self.takes = folder / "rig.toml", folder / "takes"
        self.path.write_text(tomli_w.dumps(table), encoding="utf-8")
        self.endpoint = endpoint_of(self.path)
        self._start, self._components = start, components
        self.service = start(self.path)
        with ExitStack() as stack:
            stack.callback(self._stop)
            self.listener = stack.enter_context(Listener(self.endpoint, NAME))
            self._wait(lambda: self.listener.tracks(0), START_S, "nothing was tracked")
            self._stack = stack.pop_all()

    def __enter__(self) -> "RunningRig":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _stop(self) -> None:
        self.service.stop()  # that which runs by then

    @staticmethod
    def now_ns() -> int:
        """CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    def processes(self) -> Mapping[str, int]:
        """See `Processes`."""
        return self.service.processes()

    def signal(self, component: str, number: signal.Signals) -> int:
        """Sends a signal to a process; returns the moment [ns]."""
        os.kill(self.processes()[component], number)
        return self.now_ns()

    def start_again(self) -> int:
        """Starts the processes anew after they have ended; returns the moment [ns]."""
        begin_ns = self.now_ns()
        self.service = self._start(self.path)
        return begin_ns

    def await_calm(self, timeout_s: float, since_ns: int = 0, required: bool = True) -> bool:
        """Waits until it tracks and every component says that all is well; returns whether that happened.

        Raises:
            TimeoutError: it did not happen though it is required.
        """
        since_ns = since_ns or self.now_ns()

        def calm() -> bool:
            latest = self.listener.latest(since_ns)
            all_report = all(name in latest for name in self._components)
            return all_report and all(one.level == 1 for one in latest.values()) and self.listener.tracks(since_ns)

        return self._wait(calm, timeout_s, "the rig did not become calm" if required else "")

    def await_new_frame(self, condition: Callable[[int, int], bool], timeout_s: float) -> int:
        """Waits for a depth image whose number and epoch fulfil a condition; returns its arrival [ns]."""
        seen = len(self.listener.frames)
        found: list[int] = []

        def there() -> bool:
            found.extend(t for t, seq, epoch, _ in self.listener.frames[seen:] if condition(seq, epoch))
            return bool(found)

        self._wait(there, timeout_s, "the frame did not come")
        return found[0]

    def recorded_stamps(self) -> set[int]:
        """Stops the rig and returns the stamps of all recorded depth images, of the wall clock [ns]."""
        self.service.stop()
        found: set[int] = set()
        for folder in {path.parent for path in self.takes.parent.rglob("*.mcap*")}:
            for path in leftovers(folder):
                with suppress(RecoveryError, OSError):
                    recover(path)
            infos = (FrameInfo.FromString(one.data) for _, one in recorded_messages(folder, [keys.info(DEPTH)]))
            found |= {info.header.stamp.ToNanoseconds() for info in infos}
        return found

    @staticmethod
    def on_own_clock(stamps: Iterable[int]) -> list[int]:
        """Stamps of the wall clock as times of CLOCK_MONOTONIC, sorted [ns]."""
        wall_ns = time.time_ns() - time.monotonic_ns()
        return sorted(stamp - wall_ns for stamp in stamps)

    def _wait(self, condition: Callable[[], bool], timeout_s: float, what: str) -> bool:
        """Waits for a condition; False, or an error that says `what`, when the time is over."""
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            self.service.check()
            if time.monotonic() > deadline_s:
                if what:
                    raise TimeoutError(f"{what} within {timeout_s:g} s")
                return False
            time.sleep(0.02)
        return True


def table(device: str) -> dict[str, Any]:
    """The demo rig; `device` is added to the address of its simulated device."""
    rig = demo_table(NAME)
    rig["devices"]["sim"]["uri"] += device
    rig["record"]["minimum_free_bytes"] = 20_000_000
    # Ten tries in a row are more than a rig would bear.
    rig["run"] |= {"max_restarts": 1000, "stall_timeout_s": STALL_S}
    return rig


@contextmanager
def start_run(folder: Path, device: str, room_mb: int) -> Iterator[RunningRig]:
    """`abs-service run` of the demo rig; arguments as in `fault.Fault`."""
    with _room(folder / "takes", room_mb), RunningRig(folder, table(device), Service, COMPONENTS) as rig:
        yield rig


@contextmanager
def start_on_disk(folder: Path, device: str, room_mb: int) -> Iterator[RunningRig]:
    """The same, whose recordings lie on a disk in a file."""
    with disk(folder / "takes", room_mb), RunningRig(folder, table(device), Service, COMPONENTS) as rig:
        yield rig


def _room(folder: Path, megabytes: int) -> AbstractContextManager[None]:
    """A file system of its own, in memory, at a folder; none for 0. See `mounted`."""
    return mounted(folder, "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs") if megabytes else nullcontext()


@contextmanager
def disk(folder: Path, megabytes: int) -> Iterator[None]:
    """A disk in a sparse file beside a folder, mounted there.

    Raises:
        UnavailableError: this user may not mount one, or there is no mkfs.ext4(8).
    """
    image = folder.with_suffix(".img")
    with image.open("wb") as file:
        file.truncate(megabytes * 1_000_000)
    try:
        subprocess.run(["mkfs.ext4", "-q", str(image)], check=True)
    except (FileNotFoundError, subprocess.CalledProcessError) as error:
        raise UnavailableError(f"no file system can be made in a file: {error}") from error
    with mounted(folder, "-o", "loop", str(image)):
        yield
    image.unlink()


@contextmanager
def mounted(folder: Path, *arguments: str) -> Iterator[None]:
    """A file system at a folder, by arguments of mount(8); a process that it has stopped may still be in it at the end.

    Raises:
        UnavailableError: it is refused; the message is mount's own.
    """
    folder.mkdir(exist_ok=True)
    mount(*arguments, str(folder))
    try:
        yield
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def mount(*arguments: str) -> None:
    """`mount ARGUMENTS`.

    Raises:
        UnavailableError: it is refused; the message is mount's own.
    """
    try:
        subprocess.run(["mount", *arguments], check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise UnavailableError("there is no mount(8)") from error
    except subprocess.CalledProcessError as error:
        raise UnavailableError(f"mount {' '.join(arguments)}: {error.stderr.strip()}") from error
