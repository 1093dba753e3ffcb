"""Initial extrinsics: maximum spanning tree of sensors over common shots, from the reference."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from calib import pose
from calib.pose import Pose
from calib.solve.rounding import rounded
from calib.solve.start.board_poses import PoseCandidate

#: Relative poses from two shots agree within this angle [rad] and this share of the distance to the board.
SAME_ANGLE = 0.15
SAME_SHARE = 0.15

#: Pose candidates of all sensors: by name and shot, best first.
PoseCandidates = Mapping[str, Mapping[int, Sequence[PoseCandidate]]]


class NotConnectedError(ValueError):
    """Sensors that are not connected to the reference by common shots."""


class ContradictionError(ValueError):
    """Two sensors whose common shots give inconsistent relative poses."""


def poses(seen: PoseCandidates, reference: str) -> dict[str, Pose]:
    """Pose `T_0s` of every sensor in the frame of the reference, from candidates, none of them empty.

    Raises:
        NotConnectedError: sensors that share no shot with the others; names them.
        ContradictionError: inconsistent common shots of two sensors.
    """
    found = {reference: pose.identity()}
    while len(found) < len(seen):
        edges = [(len(set(seen[old]) & set(seen[new])), old, new) for old in found for new in seen if new not in found]
        shared, old, new = max(edges, key=lambda edge: edge[0])
        if shared == 0:
            lost = ", ".join(name for name in seen if name not in found)
            raise NotConnectedError(
                f"{lost}: no shot shows the board to one of them and to one of {', '.join(found)} at the same time; "
                "take shots in which both see it, or calibrate them apart"
            )
        found[new] = found[old] @ relative_pose(seen, old, new)
    return found


def relative_pose(seen: PoseCandidates, a: str, b: str) -> Pose:
    """Pose `T_ab` consistent with most of the common shots.

    A planar board allows two poses in each image; of the four combinations only the true one is the same in all shots.

    Raises:
        ContradictionError: fewer than half of the shots agree.
    """
    shots = sorted(set(seen[a]) & set(seen[b]))
    candidates = np.stack(
        [one.T_sb @ pose.inverse(other.T_sb) for shot in shots for one in seen[a][shot] for other in seen[b][shot]]
    )
    owners = np.repeat(np.arange(len(shots)), [len(seen[a][shot]) * len(seen[b][shot]) for shot in shots])
    reach = np.median([np.linalg.norm(seen[a][shot][0].T_sb[:3, 3]) for shot in shots])
    costs = np.stack([_costs(candidate, candidates, owners, float(reach)) for candidate in candidates])
    best = costs.sum(axis=1).argmin()
    agreeing = int(np.sum(costs[best] < 1))
    if len(shots) >= 4 and agreeing * 2 < len(shots):
        alone = [np.median([seen[name][shot][0].rms_px for shot in shots]) for name in (a, b)]
        agreed = ", ".join(str(shot) for shot, cost in zip(shots, costs[best], strict=True) if cost < 1)
        raise ContradictionError(
            f"{a} and {b}: each fits its own corners, to {rounded(alone[0])} and {rounded(alone[1])} px, but only "
            f"{agreeing} of their {len(shots)} common shots agree on where they stand to each other ({agreed}): the "
            f"images of a shot were not taken at the same moment, one of the sensors was moved or mirrors its images, "
            "or names are mixed up"
        )
    return candidates[best]


def _costs(
    candidate: Pose, candidates: NDArray[np.float64], owners: NDArray[np.intp], reach: float
) -> NDArray[np.float64]:
    """Disagreement of each shot (shots,) with a candidate, clipped at 1."""
    cosines = (np.einsum("nij,ij->n", candidates[:, :3, :3], candidate[:3, :3]) - 1) / 2
    angles = np.arccos(np.clip(cosines, -1, 1)) / SAME_ANGLE
    moves = np.linalg.norm(candidates[:, :3, 3] - candidate[:3, 3], axis=1) / (SAME_SHARE * reach)
    costs = np.ones(owners[-1] + 1)
    np.minimum.at(costs, owners, np.maximum(angles, moves))
    return costs
