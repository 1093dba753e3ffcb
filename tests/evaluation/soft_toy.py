"""The real sequence: a soft toy squeezed by a hand, 120 frames of a PrimeSense-type sensor, through import and replay.

  python -m tests.evaluation.soft_toy DATA [--out FOLDER] [--picture FILE.png]

DATA is the folder with depth_mm_*.png, color_*.png and seg_*.png (the object's mask: the toy and the hand on it). The
images have no licence, so neither they nor parts of them are in this repository: the picture shows their edges only.
"""

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from abs.v1.deformation_state_pb2 import DeformationState
from abs.v1.deformed_mesh_pb2 import DeformedMesh, MeshTopology
from mcap.reader import make_reader
from numpy.typing import NDArray

from abs_service.cli import main as abs_service
from calib.camera import Camera
from tests.evaluation.residuals import Agreement, agreement

ROOT = Path(__file__).parents[2]

#: From the data's own description: 320 × 240, focal length 275 px, centre (160, 120); depth is z in millimetres.
CAMERA = Camera(320, 240, 275.0, 275.0, 160.0, 120.0)
_TABLE = "width = 320\nheight = 240\nfx = 275.0\nfy = 275.0\ncx = 160.0\ncy = 120.0\n"


@dataclass(frozen=True)
class Tracked:
    """One frame with its estimate: name, status, mesh and agreement with the depth image."""

    name: str
    status: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    agreement: Agreement


def track(data: Path, out: Path) -> list[Tracked]:
    """Imports and replays the sequence with examples/image_folder.toml; files go to the folder `out`."""
    names = sorted(path.stem.removeprefix("depth_mm_") for path in data.glob("depth_mm_*.png"))
    (out / "camera.toml").write_text(f"[depth]\n{_TABLE}\n[color]\n{_TABLE}")
    rig = (ROOT / "examples" / "image_folder.toml").read_text()
    (out / "rig.toml").write_text(rig.replace('"mask.png"', f'"{data.resolve() / f"seg_{names[0]}.png"}"'))
    images = ["--depth", "depth_mm_*.png", "--color", "color_*.png", "--camera", str(out / "camera.toml")]
    _run("import", str(data), "--layout", "pairs", *images, "--out", str(out / "toy.mcap"))
    states = out / "toy_replay.mcap"
    _run("replay", str(out / "toy.mcap"), "--config", str(out / "rig.toml"), "--out", str(states))
    return _evaluated(states, data, names)


def _run(*arguments: str) -> None:
    if code := abs_service(arguments):
        raise RuntimeError(f"abs-service {' '.join(arguments)} ended with {code}")


def _evaluated(states: Path, data: Path, names: list[str]) -> list[Tracked]:
    meshes, statuses, faces = [], [], np.zeros((0, 3), np.uint32)
    with states.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            if schema is None:
                continue
            if schema.name == MeshTopology.DESCRIPTOR.full_name:
                faces = np.frombuffer(MeshTopology.FromString(message.data).faces_u32, "<u4").reshape(-1, 3)
            elif schema.name == DeformedMesh.DESCRIPTOR.full_name:
                points = DeformedMesh.FromString(message.data).vertices_f32
                meshes.append(np.frombuffer(points, "<f4").reshape(-1, 3))
            elif schema.name == DeformationState.DESCRIPTOR.full_name:
                status = DeformationState.FromString(message.data).status
                statuses.append(DeformationState.Status.Name(status).removeprefix("STATUS_"))
    return [
        Tracked(name, status, mesh, faces, agreement(mesh, faces, distance_of(data, name), mask_of(data, name), CAMERA))
        for name, status, mesh in zip(names, statuses, meshes, strict=True)
    ]


def distance_of(data: Path, name: str) -> NDArray[np.float32]:
    """Radial distances (240, 320) [m] of a frame, NaN without return."""
    z = read(data / f"depth_mm_{name}.png").astype(np.float32) * 1e-3
    z[z == 0] = np.nan
    return (z / CAMERA.rays()[..., 2]).astype(np.float32)


def mask_of(data: Path, name: str) -> NDArray[np.bool_]:
    """The object's pixels (240, 320) of a frame."""
    return read(data / f"seg_{name}.png")[..., 3] > 0


def read(path: Path) -> NDArray[np.integer | np.floating]:
    """The pixels of an image file as they are."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileNotFoundError(path)
    return np.asarray(image)


def table(frames: list[Tracked]) -> str:
    """Every twelfth frame, then the median and the worst of all, as Markdown."""
    values = np.array(
        [(f.agreement.forward_mm, f.agreement.backward_mm, f.agreement.inside, f.agreement.covered) for f in frames]
    )
    rows = [(f.name, f.status, value) for f, value in zip(frames, values)][::12]
    worst = np.array([values[:, 0].max(), values[:, 1].max(), values[:, 2].min(), values[:, 3].min()])
    tracking = f"{sum(f.status == 'TRACKING' for f in frames)} of {len(frames)}"
    rows += [("median", tracking, np.median(values, axis=0)), ("worst", tracking, worst)]
    lines = [
        "| frame | TRACKING | forward mm | backward mm | vertices inside | mask covered |",
        "|---|---|---|---|---|---|",
    ]
    lines += [f"| {n} | {s} | {v[0]:.2f} | {v[1]:.2f} | {v[2]:.1%} | {v[3]:.1%} |" for n, s, v in rows]
    return "\n".join(lines)


def main() -> None:
    """Runs the evaluation and prints its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, metavar="DATA")
    parser.add_argument("--out", type=Path, help="folder for the recordings (default: a temporary one)")
    parser.add_argument("--picture", type=Path, help="draw four frames")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        out = arguments.out or Path(temporary)
        out.mkdir(parents=True, exist_ok=True)
        frames = track(arguments.data, out)
    print(table(frames))
    if arguments.picture:
        from tests.evaluation.picture import draw

        draw(arguments.data, frames, arguments.picture)


if __name__ == "__main__":
    sys.exit(main())
