"""Recordings of a simulated calibration board, with what is true about it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from abs_service.commands.images import import_file
from calib.board.target import Target
from calib.camera import Camera
from calib.pose import Pose
from drivers.contract.frame import Frame
from drivers.simulated.address import parse
from drivers.simulated.shapes.printed import TARGETS, board_pose
from drivers.simulated.simulation import Simulation


@dataclass(frozen=True)
class Filmed:
    """The first exposures of a simulated board; see `drivers.encoding.foreign_recording.ForeignRecording`."""

    simulation: Simulation
    exposures: int
    total: int | None = None

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """Cameras by sensor."""
        return {name: head.camera for name, head in self.simulation.heads.items()}

    def frames(self) -> Iterator[Frame]:
        """Frames of all exposures, in order."""
        for k in range(self.exposures):
            yield from self.simulation.frames(k)


@dataclass(frozen=True)
class Scene:
    """A moving board in front of the simulated device.

    Attributes:
        board: name of the target, a key of `TARGETS`.
        uri: address of the simulated device.
    """

    board: str
    uri: str

    @property
    def target(self) -> Target:
        """The board."""
        return TARGETS[self.board]

    @property
    def simulation(self) -> Simulation:
        """A new simulation of the address."""
        return parse(self.uri).build()

    def true_pose(self, simulation: Simulation, t_s: float) -> Pose:
        """Pose of the board at a time [s]."""
        return board_pose(simulation.scene.surfaces[0], self.target, t_s)


def scene(board: str, *more: str) -> Scene:
    """The scene of a board, with more parts `KEY=VALUE` of its address."""
    return Scene(board, "&".join([f"simulated://target?board={board}", *more]))


def record(filmed: Filmed, path: Path) -> Path:
    """Writes the exposures as a recording, and returns its path."""
    import_file.write(path, "board", filmed, b"")
    return path
