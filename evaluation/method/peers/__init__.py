"""Against peers: the same sequences for our trackers, for point-set registrations and for a plain Gauss–Newton fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.experiment import Context, Findings, Goal, at_most
from evaluation.method.peers import report, rivals
from evaluation.method.peers.gauss_newton import GaussNewton
from evaluation.method.peers.measuring import Followed, Make, follow, least, with_template
from evaluation.method.peers.ours import SETUPS, Ours
from evaluation.method.peers.rivals import Follower
from evaluation.scenes.bent_sheet import Leap, Scene, Shot, film, spin, turn

__all__ = ["QUICK", "TITLE", "Settings", "run"]

TITLE = "Against peers: time, vertex and surface error on the same sequences"

#: The row that goals are about, the rivals' row that is the hardest to beat, and the fastest point-set method.
BEST, GAUSS_NEWTON = "hybrid, NURBS 5 × 4, degree 3", "Gauss–Newton, NumPy"
FASTEST = "rustcpd, rank 60, k 10, f32"
TOLD = "Gauss–Newton, told of the hole"

#: Frames until a sheet that leapt has to be found again; the leap is after the third.
LEAP_FRAMES = 20

#: Frames that the slowest rivals follow.
SLOW_FRAMES = 11

SCENES: Mapping[str, Scene] = {
    scene.name: scene
    for scene in (
        Scene("5 mm"),
        Scene("15 mm", sigma=15e-3),
        Scene("hole", hole=(45, 22)),
        Scene("turn", turn),
        Scene("spin", spin),
    )
}


#: A scene, and one sequence of it.
Film = tuple[Scene, Sequence[Shot]]


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is measured.

    Attributes:
        seeds: sequences of every scene.
        frames: of a sequence.
        repeats: how often every tracker follows a sequence, in turns; the least time of each frame counts.
        setups: which of our trackers.
        peers: which other programs, if they are installed.
        slow: which of them follow a few frames only.
        leaps: how many sheets leap.
        leapers: which of our trackers follow those.
    """

    seeds: int = 3
    frames: int = 40
    repeats: int = 15
    setups: tuple[str, ...] = tuple(SETUPS)
    peers: tuple[str, ...] = tuple(rivals.KNOWN)
    slow: tuple[str, ...] = ("pycpd", "rustcpd, full rank", "trimesh nricp_amberg", "trimesh nricp_sumner")
    leaps: int = 16
    leapers: tuple[str, ...] = (BEST,)


QUICK = Settings(1, 6, 1, (BEST,), (FASTEST,), (), 2, (BEST,))


def run(settings: Settings, context: Context) -> Findings:
    """Lets every tracker follow every scene."""
    found: dict[str, dict[str, list[Followed]]] = {}
    for name, scene in SCENES.items():
        context.progress(f"scene {name}")
        rows: dict[str, list[Followed]] = {}
        makers = _makers(settings, scene, first=name == "5 mm")
        films = _films(scene, settings, context.seed)
        few = [(scene, shots[:SLOW_FRAMES]) for _, shots in films[:1]]
        for _ in range(settings.repeats):
            for title, make in makers.items():
                again = _follow(make, few if title in settings.slow else films, context.seed)
                before = rows.setdefault(title, again)
                rows[title] = [least(same) for same in zip(before, again)]
        found[name] = rows
    context.progress("leaps")
    leaps = _leaps(settings, context.seed)
    leapt = {title: _follow(make, leaps, context.seed) for title, make in _leapers(settings).items()}
    missing = sorted(
        {rivals.KNOWN[name][0].partition(".")[0] for name in settings.peers if not rivals.installed([name])}
    )
    return Findings(
        goals=_goals(found, leapt),
        sections=report.sections(SCENES, found, leapt, missing, settings.slow),
        values={"scenes": {name: report.values(rows) for name, rows in found.items()}, "leaps": report.losses(leapt)},
    )


def _ours(name: str) -> Make:
    def start(first: Shot, sigma: float, seed: int) -> tuple[Follower, NDArray[np.float64]]:
        tracker = Ours(SETUPS[name], first, sigma, seed)
        return tracker, tracker.places

    return start


def _makers(settings: Settings, scene: Scene, first: bool) -> dict[str, Make]:
    """Who follows a scene: all the first, the others those that goals are about and the fastest of the rivals."""
    ours = {name: _ours(name) for name in settings.setups if first or name == BEST}
    newton = {GAUSS_NEWTON: with_template(lambda vertices: GaussNewton(vertices, scene.sigma))}
    if any(scene.hole):
        newton[TOLD] = with_template(lambda vertices: GaussNewton(vertices, scene.sigma, knows_hole=True))
    others = rivals.installed([name for name in settings.peers if first or name == FASTEST])
    still = {"none: the first pose": with_template(rivals.Still)}
    return ours | newton | {name: with_template(make) for name, make in others.items()} | still


def _leapers(settings: Settings) -> dict[str, Make]:
    newton = with_template(lambda vertices: GaussNewton(vertices, 5e-3))
    return {name: _ours(name) for name in settings.leapers} | {GAUSS_NEWTON: newton}


def _films(scene: Scene, settings: Settings, seed: int) -> list[Film]:
    """A sequence of the scene for each seed."""
    generators = (np.random.default_rng([seed, k]) for k in range(settings.seeds))
    return [(scene, film(scene, range(settings.frames), generator)) for generator in generators]


def _leaps(settings: Settings, seed: int) -> list[Film]:
    """A sequence of every leap."""
    filmed = []
    for k in range(settings.leaps):
        generator = np.random.default_rng([seed, k])
        scene = Scene("leap", Leap(generator))
        filmed.append((scene, film(scene, range(LEAP_FRAMES), generator)))
    return filmed


def _follow(make: Make, films: Sequence[Film], seed: int) -> list[Followed]:
    """What a tracker makes of sequences."""
    followed = []
    for k, (scene, shots) in enumerate(films):
        follower, at = make(shots[0], scene.sigma, seed + k)
        followed.append(follow(follower, at, shots))
    return followed


def _goals(
    found: Mapping[str, Mapping[str, Sequence[Followed]]], leapt: Mapping[str, Sequence[Followed]]
) -> tuple[Goal, ...]:
    best = {name: rows[BEST] for name, rows in found.items()}

    def mean(scene: str, what: str) -> float:
        return float(np.mean([getattr(one, what).mean() for one in best[scene]]))

    lost = [one.lost for one in leapt[GAUSS_NEWTON]]
    both = sum(here.lost for here, there in zip(leapt[BEST], lost) if there)
    return (
        at_most(
            f"Time a frame, {BEST}, median", np.median(np.concatenate([one.cpu_ms for one in best["5 mm"]])), 4, "ms"
        ),
        at_most("Vertex error at 5 mm noise", mean("5 mm", "vertex_mm"), 2.0, "mm"),
        at_most("Surface error at 5 mm noise", mean("5 mm", "surface_mm"), 0.7, "mm"),
        at_most("Vertex error at 15 mm noise", mean("15 mm", "vertex_mm"), 3.5, "mm"),
        at_most("Vertex error with a hand-sized hole", mean("hole", "vertex_mm"), 5.0, "mm"),
        at_most(
            "Turns by 90° in 0.25 s that are lost", sum(one.lost for name in ("turn", "spin") for one in best[name]), 0
        ),
        at_most(f"Of {sum(lost)} leaps that Gauss–Newton loses, those that are lost here, too", both, 0),
    )
