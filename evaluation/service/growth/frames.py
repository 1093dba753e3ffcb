"""Cost of a frame of one tracker, by vertices, control points, pixels, sensors and candidates.

All trackers of an axis take each exposure in turn, so that a neighbour on the machine slows all of them alike.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from abs_service.tracker.estimates.estimate import Status
from abs_service.tracker.models import nurbs
from abs_service.tracker.optimizers import cma_es
from abs_service.tracking.plan import Plan
from abs_service.tracking.session import TrackingSession
from calib.rig import Rig
from evaluation.sequences import demo_plan, demo_rig, expose, moving_indices, simulate

#: Frames at the beginning that are not counted: the first contains the initial detection, and kernels are loaded.
FIRST = 5

#: Exposures from one frame to the next.
STRIDE = 2

#: The device of the axes that are not about pixels.
SMALL_SHEET = "simulated://sheet?seed=1"

#: Generations of the search whose candidates are counted.
GENERATIONS = 20


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """A tracker: the address of the simulated device that it sees, its rig and plan."""

    address: str
    rig: Rig
    plan: Plan


@dataclass(frozen=True)
class Axis:
    """Something that a frame's cost grows with.

    Attributes:
        unit: what is counted.
        setups: makes the tracker for a number of the unit, by number.
        power: of the number in the law that is fitted.
        condition: what is the same for all numbers.
    """

    unit: str
    setups: Mapping[float, Callable[[], Setup]]
    power: float
    condition: str


def axes() -> tuple[Axis, ...]:
    """All axes."""
    demo = "depth of 176 × 144 and colour of 320 × 240 pixels"
    return (
        Axis(
            "vertices",
            {n: partial(_vertices, n) for n in (100, 200, 400, 800, 1600)},
            1,
            f"6 × 5 control points, {demo}",
        ),
        Axis(
            "parameters in Θ",
            {3 * k * k: partial(_control_points, k) for k in (4, 6, 8, 10, 12)},
            2,
            f"three for each control point; 600 vertices, {demo}",
        ),
        Axis(
            "pixels of an exposure",
            {2 * 12 * k * k: partial(_pixels, k) for k in (40, 80, 120, 160, 200)},
            1,
            "depth with amplitudes, and colour, of the same size; 300 vertices, the same part of the image",
        ),
        Axis(
            "depth sensors",
            {n: partial(_sensors, n) for n in (1, 2, 3, 4, 6)},
            1,
            "176 × 144 pixels each, without colour; 300 vertices",
        ),
        Axis(
            "candidates of a generation",
            {n: partial(_population, n) for n in (4, 8, 16, 32, 64)},
            1,
            f"`cma_es`, {GENERATIONS} generations; 300 vertices, {demo}",
        ),
    )


@dataclass(frozen=True, slots=True)
class Point:
    """Cost of the frames with a number of something.

    Attributes:
        number: of the unit.
        median_ms, p95_ms: processor time of a frame, median and 95th percentile [ms].
        tracking: share of the frames that are TRACKING.
    """

    number: float
    median_ms: float
    p95_ms: float
    tracking: float


def measure(axis: Axis, frames: int) -> Sequence[Point]:
    """Points of an axis.

    Args:
        axis: the axis.
        frames: that every tracker takes; at least `FIRST`.
    """
    setups = {number: make() for number, make in axis.setups.items()}
    sessions = {number: TrackingSession(one.rig, one.plan) for number, one in setups.items()}
    took_ms: dict[float, list[float]] = {number: [] for number in setups}
    devices = {one.address: simulate(one.address) for one in setups.values()}
    tracked = dict.fromkeys(setups, 0)
    for index in moving_indices(frames, STRIDE):
        seen = {address: expose(one, [index])[0].frames for address, one in devices.items()}
        for number, session in sessions.items():
            begin = time.thread_time()
            estimate = session.track(seen[setups[number].address], lambda: True)
            took_ms[number].append(1e3 * (time.thread_time() - begin))
            tracked[number] += estimate.status == Status.TRACKING
    return [
        Point(number, float(np.median(one[FIRST:])), float(np.quantile(one[FIRST:], 0.95)), tracked[number] / len(one))
        for number, one in took_ms.items()
    ]


def _setup(address: str, plan: Plan) -> Setup:
    return Setup(address, demo_rig(simulate(address)), plan)


def _vertices(number: int) -> Setup:
    return _setup(SMALL_SHEET, demo_plan(nurbs.Settings(), vertices=number))


def _control_points(side: int) -> Setup:
    return _setup(SMALL_SHEET, demo_plan(nurbs.Settings((side, side)), vertices=600))


def _pixels(scale: int) -> Setup:
    size = f"{4 * scale}x{3 * scale}"
    return _setup(f"simulated://sheet?seed=1&tof={size}&color={size}", demo_plan(nurbs.Settings()))


def _sensors(number: int) -> Setup:
    setup = _setup(SMALL_SHEET, demo_plan(nurbs.Settings(), reference="tof/0"))
    one, names = setup.rig.sensors["tof"], [f"tof/{k}" for k in range(number)]
    return replace(setup, rig=replace(setup.rig, sensors={name: replace(one, name=name) for name in names}))


def _population(number: int) -> Setup:
    search = cma_es.Settings(population=number, generations=GENERATIONS, tolerance=1e-12)
    return _setup(SMALL_SHEET, demo_plan(nurbs.Settings(), optimizer=search, evaluations=10**9))
