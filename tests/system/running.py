"""A running demo rig as the tests see it: its configuration, its processes and everything that it publishes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Self

from absmsg.v1.deformation_state_pb2 import DeformationState
from absmsg.v1.frame_info_pb2 import FrameInfo
from absmsg.v1.health_pb2 import Health
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage

from abs_service.bus.contract import Sample
from evaluation.service.live.subscriber import connect

#: The first start on a machine compiles the kernels.
START_S = 150.0

TRACKING = DeformationState.STATUS_TRACKING


def write_rig(path: Path, endpoint: str) -> Path:
    """The demo rig on an endpoint of its own; records to `takes` beside the file."""
    text = resources.files("abs_service.config").joinpath("demo.toml").read_text(encoding="utf-8")
    text = text.replace("tcp/127.0.0.1:7447", endpoint).replace('directory = "recordings"', 'directory = "takes"')
    text = text.replace("minimum_free_bytes = 1_000_000_000", "minimum_free_bytes = 0")
    assert endpoint in text
    assert '"takes"' in text
    path.write_text(text, encoding="utf-8")
    return path


@dataclass(frozen=True)
class Received:
    """A message and when it arrived, CLOCK_MONOTONIC [ns]."""

    t_ns: int
    sample: Sample


class RigListener:
    """A client of the rig that keeps everything that was published, images without their pixels."""

    def __init__(self, endpoint: str, pattern: str = "**", rig: str = "demo"):
        self.received: list[Received] = []
        self._bus = connect(endpoint, rig)
        self._bus.subscribe(pattern, self._take)

    def _take(self, sample: Sample) -> None:
        is_image = sample.message == RawImage.DESCRIPTOR.full_name
        kept = Sample(sample.topic, sample.message, b"" if is_image else sample.payload, sample.attachment)
        self.received.append(Received(time.monotonic_ns(), kept))

    def close(self) -> None:
        self._bus.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def states(self, tracker: str = "sheet") -> list[tuple[int, DeformationState]]:
        """Every estimate of a tracker so far and when it arrived [ns]."""
        return [(one.t_ns, DeformationState.FromString(one.sample.payload)) for one in self._of(f"{tracker}/state")]

    def frames(self, topic: str) -> list[FrameInfo]:
        """The descriptions of all images of a topic."""
        return [FrameInfo.FromString(one.sample.attachment) for one in self._of(topic)]

    def health(self, component: str) -> list[Health]:
        """All health messages of a component."""
        return [health for _, health in self.timed_health(component)]

    def timed_health(self, component: str) -> list[tuple[int, Health]]:
        """All health messages of a component and when each arrived [ns]."""
        return [(one.t_ns, Health.FromString(one.sample.payload)) for one in self._of(f"health/{component}")]

    def tracks_since(self, t_ns: int, count: int = 3) -> Callable[[], bool]:
        """A condition: so many estimates whose exposure was after `t_ns` say TRACKING."""

        def holds() -> bool:
            late = [state for _, state in self.states() if state.header.t_host_ns > t_ns and state.status == TRACKING]
            return len(late) >= count

        return holds

    def _of(self, topic: str) -> list[Received]:
        return [one for one in self.received if one.sample.topic == topic]


def wait_until(condition: Callable[[], Any], timeout_s: float, what: str) -> Any:
    """Value of the condition as soon as it is true."""
    deadline_s = time.monotonic() + timeout_s
    while not (result := condition()):
        assert time.monotonic() < deadline_s, f"{what} did not happen within {timeout_s:g} s"
        time.sleep(0.05)  # looks at processes and files, which wake nobody up
    return result


def kill(pid: int) -> int:
    """`kill -9`; returns the moment, CLOCK_MONOTONIC [ns]."""
    os.kill(pid, signal.SIGKILL)
    return time.monotonic_ns()


def abs_service(*arguments: object, timeout_s: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Runs `abs-service ARGUMENTS` to its end."""
    return subprocess.run(
        [sys.executable, "-m", "abs_service", *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
    )
