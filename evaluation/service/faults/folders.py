"""Faults of the folder of the recordings and of its disk."""

import os
import resource
import subprocess
import time

from absmsg.v1.health_pb2 import Health

from evaluation.service.faults.fault import PATIENCE_S, Elsewhere, Fault, Made
from evaluation.service.faults.running import RunningRig, mount, mounted, start_on_disk
from evaluation.service.live.proc import is_running

#: For how long the recorder cannot record, after it has said so [s].
FAULT_S = 2.0
#: Size of a file system of its own, in memory or in a sparse file: too large to be full within the hour [MB].
ROOM_MB = 100_000
#: What is left of it then, less than `record.minimum_free_bytes`.
LEFT_BYTES = 15_000_000


def filled(rig: RunningRig) -> Made:
    """The disk shrinks until it is nearly full, and grows again; the recorder is to stop before it is full."""
    room = os.statvfs(rig.takes)
    used = (room.f_blocks - room.f_bavail) * room.f_frsize
    begin_ns = rig.now_ns()
    mount("-o", f"remount,size={used + LEFT_BYTES}", str(rig.takes))
    broken = _await_failure(rig, begin_ns)
    mount("-o", f"remount,size={ROOM_MB}m", str(rig.takes))
    return Made(begin_ns, rig.now_ns(), broken)


def refused(rig: RunningRig) -> Made:
    """The disk takes no byte of the recorder (RLIMIT_FSIZE of 0, EFBIG)."""
    recorder, begin_ns = rig.processes()["record"], rig.now_ns()
    before = resource.prlimit(recorder, resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
    broken = _await_failure(rig, begin_ns)
    resource.prlimit(recorder, resource.RLIMIT_FSIZE, before)
    return Made(begin_ns, rig.now_ns(), broken)


def read_only(rig: RunningRig) -> Made:
    """Something read-only is mounted over the folder, and unmounted."""
    begin_ns = rig.now_ns()
    with mounted(rig.takes, "-t", "tmpfs", "-o", "ro,size=1m", "tmpfs"):
        broken = _await_failure(rig, begin_ns)
    return Made(begin_ns, rig.now_ns(), broken)


def deleted(rig: RunningRig) -> Made:
    """The open file is deleted; what it held is read through a descriptor that was open before."""
    # One that a killed recorder left may be there for a moment, until it is recovered.
    active = max(rig.takes.glob("*.active"), key=lambda path: path.stat().st_mtime_ns)
    kept = rig.path.parent / "deleted"
    kept.mkdir(exist_ok=True)
    held = active.open("rb")
    begin_ns = rig.now_ns()
    active.unlink()
    broken = _await_failure(rig, begin_ns)
    with held, (kept / f"{len(list(kept.iterdir()))}.mcap.active").open("wb") as copy:
        while block := held.read(1 << 20):
            copy.write(block)
    return Made(begin_ns, begin_ns, broken)


def renamed(rig: RunningRig) -> Made:
    """The folder gets another name, with the open file in it."""
    moved = len(list(rig.path.parent.glob("moved*")))
    begin_ns = rig.now_ns()
    rig.takes.rename(rig.takes.with_name(f"moved{moved}"))
    return Made(begin_ns, begin_ns, _await_failure(rig, begin_ns))


def replaced(rig: RunningRig) -> Made:
    """A file stands in the folder's place while the recorder is killed."""
    moved = len(list(rig.path.parent.glob("moved*")))
    begin_ns = rig.now_ns()
    rig.takes.rename(rig.takes.with_name(f"moved{moved}"))
    rig.takes.write_text("in the way", encoding="utf-8")
    recorder = rig.processes()["record"]
    os.kill(recorder, 9)
    broken = _await_failure(rig, begin_ns)
    rig.takes.unlink()
    return Made(begin_ns, rig.now_ns(), broken or ("the recorder lives" if is_running(recorder) else ""))


def frozen(rig: RunningRig) -> Made:
    """The disk answers no more (fsfreeze), and goes on."""
    begin_ns = rig.now_ns()
    subprocess.run(["fsfreeze", "--freeze", str(rig.takes)], check=True)
    try:
        broken = _await_words(rig, begin_ns, "the disk has not answered")
    finally:
        subprocess.run(["fsfreeze", "--unfreeze", str(rig.takes)], check=True)
    return Made(begin_ns, rig.now_ns(), broken)


def _await_failure(rig: RunningRig, since_ns: int) -> str:
    """Waits until health says RECORD_FAILED, and `FAULT_S` more; words if it never does."""
    return _await_words(rig, since_ns, "RECORD_FAILED")


def _await_words(rig: RunningRig, since_ns: int, words: str) -> str:
    """Waits until the recorder's health is not OK with some words, and `FAULT_S` more; other words if it never is."""
    while rig.now_ns() < since_ns + PATIENCE_S * 1e9:
        said = [one for t_ns, one in rig.listener.health[-50:] if t_ns > since_ns and one.component == "record"]
        if any(one.level != Health.LEVEL_OK and words in one.message for one in said):
            time.sleep(FAULT_S)
            return ""
        time.sleep(0.02)
    return f"health never said {words}"


_TRACKS = "tracking goes on; RECORD_FAILED, and recording again when it can"

FAULTS = (
    Fault("the disk of the recordings is full (a tmpfs)", _TRACKS, filled, recording_s=1.5, room_mb=ROOM_MB),
    Fault("the disk takes no byte (RLIMIT_FSIZE)", _TRACKS, refused, recording_s=1.5),
    Fault("the folder becomes read-only (a mount over it)", _TRACKS, read_only),
    Fault("the open file is deleted", f"{_TRACKS}; no image after the deletion is lost", deleted),
    Fault("the folder is renamed", f"{_TRACKS}; nothing is lost", renamed),
    Fault(
        "a file in the folder's place, and kill -9 of `record`",
        _TRACKS,
        replaced,
        recording_s=1.5,
        restarted=frozenset({"record"}),
    ),
    Fault(
        "the disk does not answer (fsfreeze)",
        "tracking goes on; in health within 2 s; nothing is lost that memory holds",
        frozen,
        room_mb=ROOM_MB,
        start=start_on_disk,
    ),
    Elsewhere(
        "the disk is slower than the cameras",
        "nobody waits; every drop is counted",
        "tests/abs_service/recording/disk/test_recorder_disk.py",
    ),
    Elsewhere(
        "a folder with 100,000 recordings",
        "recording goes on while old ones are looked for",
        "tests/abs_service/recording/disk/test_disk_monitor.py",
    ),
    Elsewhere(
        "truncated or flipped bytes in a recording",
        "recovery skips bad chunks only and counts them",
        "tests/abs_service/recording/test_recovery.py",
    ),
)
