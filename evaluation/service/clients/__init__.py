"""Age of an estimate when a program in each language has it, at 30 Hz, on one host.

A publisher stands for a tracker: it sends states with 48 parameters and their covariance, and meshes of 400 vertices,
each with the moment of its publication as that of the exposure. So the age is that of the way alone. Programs are those
of examples/, and two as short as these; they run one after the other.

Statistic: median and 95th percentile of the age on arrival, over all estimates after the first second; the median of
every program over that of Python with its mesh.
Goal: no program is later, in the median, than half of a period (16.7 ms). Not required: it is a matter of the machine.
Seeds: none; one run of 20 s for each program.
"""

import os
import shutil
import socket
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from abs_service.bus.session import SessionMode
from abs_service.bus.zenoh_bus import ZenohBus
from abs_service.report.content import Cell, Column, Section, Table
from evaluation.experiment import Context, Findings, at_most
from evaluation.service.clients.programs import Program, ages_ms, started
from evaluation.service.clients.publisher import RATE_HZ, publishing

TITLE = "Clients: age of estimates in programs of each language"

#: Variable of the environment that names examples/cpp, built; without it C++ is left out.
CPP = "ABS_CPP_SUBSCRIBER"

_EXAMPLES = Path(__file__).parents[3] / "examples"
_HERE = Path(__file__).parent
_REFERENCE = "Python, abs_client"

_COLUMNS = (
    Column("program"), Column("lines"), Column("estimates"), Column("age, median", "ms", ".1f"),
    Column("95th percentile", "ms", ".1f"), Column("median over Python's", "", ".1f"),
)  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """Size of the experiment.

    Attributes:
        duration_s: of each program [s].
    """

    duration_s: float = 20.0


QUICK = Settings(duration_s=3.0)


def run(settings: Settings, context: Context) -> Findings:
    """Lets one program after the other receive."""
    rig, web, ros = (f"127.0.0.1:{port}" for port in _free_ports(3))
    measured: dict[Program, np.ndarray] = {}
    with ZenohBus.open("demo", f"tcp/{rig}", SessionMode.ROUTER) as bus, publishing(bus), _bridges(rig, web, ros):
        for program in _programs(rig, web, ros):
            context.progress(program.name)
            measured[program] = ages_ms(program, settings.duration_s)
    reference = next(float(np.median(ages)) for program, ages in measured.items() if program.name == _REFERENCE)
    rows: list[tuple[Cell, ...]] = [
        (
            program.name,
            len(program.source.read_text("utf-8").splitlines()),
            int(np.isfinite(ages).sum()),
            float(np.median(ages)),
            float(np.quantile(ages, 0.95)),
            float(np.median(ages)) / reference,
        )
        for program, ages in measured.items()
    ]
    worst = float(np.max([np.median(ages) for ages in measured.values()]))  # NaN if one printed none
    goal = at_most("Median age in the slowest program", worst, 500 / RATE_HZ, "ms")
    table = Table("Every program", _COLUMNS, tuple(rows))
    values = {program.name: np.round(ages, 3).tolist() for program, ages in measured.items()}
    return Findings((goal,), (Section("Estimates on arrival", (table,)),), values)


def _programs(rig: str, web: str, ros: str) -> Iterator[Program]:
    python, endpoint = sys.executable, f"tcp/{rig}"
    mesh, node = _HERE / "mesh_ages.py", _HERE / "ros_ages.py"
    state, script = _EXAMPLES / "subscribe.py", _EXAMPLES / "javascript" / "states.mjs"
    yield Program(_REFERENCE, mesh, (python, str(mesh), endpoint))
    yield Program("Python, zenoh", state, (python, str(state), "--endpoint", endpoint))
    if built := os.environ.get(CPP):
        yield Program("C++, zenoh-pico", _EXAMPLES / "cpp" / "subscribe.cpp", (built, endpoint))
    if command := shutil.which("node"):
        yield Program("JavaScript (Node), abs-web", script, (command, str(script), f"http://{web}"))
    yield Program("ROS 2's layout, abs-ros2", node, (python, str(node), f"tcp/{ros}"))


@contextmanager
def _bridges(rig: str, web: str, ros: str) -> Iterator[None]:
    with (
        tempfile.TemporaryDirectory() as folder,
        ZenohBus.open("ros", f"tcp/{ros}", SessionMode.ROUTER),
        started(_module("web", rig, "--port", web.partition(":")[2]), Path(folder)),
        started(_module("ros2", rig, "--router", f"tcp/{ros}"), Path(folder)),
    ):
        yield


def _module(name: str, rig: str, *arguments: str) -> Sequence[str]:
    return sys.executable, "-m", f"abs_client.{name}", "--endpoint", f"tcp/{rig}", *arguments


def _free_ports(count: int) -> list[int]:
    probes = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports
