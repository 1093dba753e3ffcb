"""Checks what a run of the service left behind: it tracked well, and its recording is complete.

make run ARGS="--duration 20 --json" | tee OUTPUT
.venv/bin/python tests/repository/ci_smoke.py OUTPUT recordings
"""

import json
import sys
from collections import Counter
from pathlib import Path
from statistics import fmean

from absmsg.v1.deformation_state_pb2 import DeformationState
from mcap.reader import make_reader

#: What the tracker promises for the simulated sheet: mean distance of the vertices from where they truly are [mm].
MAX_ERROR_MM = 5.0


def main(output: Path, recordings: Path) -> None:
    """Raises `SystemExit` with a sentence about the first thing that is missing."""
    lines = [json.loads(line) for line in output.read_text(encoding="utf-8").splitlines() if line.startswith("{")]
    estimates = Counter(estimate.get("status", "no estimate") for estimate in lines)
    expect(estimates["TRACKING"] > 0, f"no estimate says TRACKING, but {dict(estimates)}")
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


def expect(holds: bool, otherwise: str) -> None:
    """Ends the script unless it holds."""
    if not holds:
        sys.exit(f"smoke test: {otherwise}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
