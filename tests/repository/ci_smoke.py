"""Starts the service as a newcomer does, and checks what it left: it tracked well, and its recording is complete.

.venv/bin/python tests/repository/ci_smoke.py FOLDER    records to FOLDER, which is empty
"""

import json
import os
import signal
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path
from statistics import fmean
from typing import Any

from absmsg.v1.deformation_state_pb2 import DeformationState
from mcap.reader import make_reader

#: What the tracker promises for the simulated sheet: mean distance of the vertices from where they truly are [mm].
MAX_ERROR_MM = 5.0
#: Estimates that say TRACKING after which it is asked to end: those of twenty seconds.
ENOUGH = 600
#: Time that it has for them [s]: the first start on a machine compiles the kernels.
PATIENCE_S = 300.0


def main(recordings: Path) -> None:
    """Raises `SystemExit` with a sentence about the first thing that is missing."""
    lines = tracked(recordings)
    estimates = Counter(estimate.get("status", "no estimate") for estimate in lines)
    expect(estimates["TRACKING"] >= ENOUGH, f"{ENOUGH} estimates have to say TRACKING, but there are {dict(estimates)}")
    errors_mm = [estimate["error_mm"] for estimate in lines if estimate.get("error_mm") is not None]
    expect(bool(errors_mm), "no estimate was compared with the simulator's truth")
    error_mm = fmean(errors_mm)
    expect(error_mm < MAX_ERROR_MM, f"the vertices are {error_mm:.2f} mm off, allowed are {MAX_ERROR_MM:g} mm")

    complete = sorted(recordings.glob("*.mcap"), key=lambda path: path.stat().st_mtime)
    expect(bool(complete), f"no finished recording in {recordings}: {sorted(recordings.iterdir())}")
    topics: Counter[str] = Counter()
    recorded: Counter[int] = Counter()
    with complete[-1].open("rb") as stream:
        reader = make_reader(stream)
        attachments = {attachment.name for attachment in reader.iter_attachments()}
        for _, channel, message in reader.iter_messages():
            topics[channel.topic] += 1
            if channel.topic.endswith("/state"):
                recorded[DeformationState.FromString(message.data).status] += 1
    images = {topic for topic in topics if topic.endswith("/image")}
    expect("rig.toml" in attachments, f"the recording does not say how it was made: {attachments}")
    expect(len(images) >= 2, f"depth and colour images are not recorded: {dict(topics)}")
    expect(recorded[DeformationState.STATUS_TRACKING] > 0, f"no TRACKING estimate is recorded: {dict(topics)}")
    apart = [topic for topic in images if topics[topic] != topics[topic.removesuffix("image") + "info"]]
    expect(not apart, f"images without their description in {apart}: {dict(topics)}")
    print(f"{sum(estimates.values())} estimates, {dict(estimates)}, vertex error {error_mm:.2f} mm on average")
    print(f"{complete[-1]} holds {dict(topics)}")


def tracked(recordings: Path) -> list[dict[str, Any]]:
    """Estimates of `make run`, which is asked to end when there are enough; prints what else it says."""
    estimates: list[dict[str, Any]] = []
    tracking = 0
    with subprocess.Popen(
        ["make", "run", f"ARGS=--json --out {recordings}"], stdout=subprocess.PIPE, text=True
    ) as make:
        watchdog = threading.Timer(PATIENCE_S, ask_to_end, [make.pid])
        watchdog.start()
        for line in make.stdout or ():
            if not line.startswith("{"):
                print(line, end="")
                continue
            estimates.append(json.loads(line))
            if estimates[-1].get("status") == "TRACKING":
                tracking += 1
                if tracking == ENOUGH:
                    ask_to_end(make.pid)
        watchdog.cancel()
    expect(make.returncode == 0, f"make run ended with {make.returncode}")
    return estimates


def ask_to_end(make: int) -> None:
    """SIGTERM to what make has started, so that make returns its exit code."""
    for child in Path(f"/proc/{make}/task/{make}/children").read_text(encoding="utf-8").split():
        os.kill(int(child), signal.SIGTERM)


def expect(holds: bool, otherwise: str) -> None:
    """Ends the script unless it holds."""
    if not holds:
        sys.exit(f"smoke test: {otherwise}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
