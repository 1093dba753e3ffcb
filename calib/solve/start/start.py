"""Initial state: each camera separately, then extrinsics, then board poses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib import pose
from calib.board.views import CornerView, PlaneView
from calib.camera import Camera
from calib.lenses.lens import LensError
from calib.pose import Pose
from calib.solve.bundle.adjustment import NotSolvedError, search
from calib.solve.bundle.formulation import formulate
from calib.solve.bundle.parameters.lens_parameters import FISHEYE
from calib.solve.bundle.parameters.state import SensorState, State
from calib.solve.bundle.tasks import SensorTask, Task
from calib.solve.start import extrinsics_graph, registration, symmetric_boards
from calib.solve.start.board_poses import PoseCandidate, initial_camera, plain_camera, pose_candidates

#: Reprojection errors are clipped here [px] when board poses are compared.
FAR_PX = 20.0


def start(task: Task, note: Callable[[str], None]) -> tuple[Task, State]:
    """Initial state, and the task without views that have no valid board pose.

    Raises:
        NotConnectedError, ContradictionError: see `extrinsics_graph`.
        NotSolvedError: no view of a sensor has a valid board pose.
    """
    cameras: dict[str, Camera] = {}
    seen: dict[str, dict[int, list[PoseCandidate]]] = {}
    for name, sensor in task.sensors.items():
        views = [view for view in task.corners if view.sensor == name]
        planes = [view for view in task.planes if view.sensor == name]
        cameras[name] = _camera(name, sensor, views, planes, note)
        found = {view.shot: pose_candidates(cameras[name], view) for view in views}
        if views and not any(found.values()):
            raise NotSolvedError(f"{name}: no view shows a board that its camera could have seen")
        if views:
            seen[name] = {shot: each for shot, each in found.items() if each}
    if task.two_ways_up and len(seen) > 1:
        task, seen = _numbered_alike(task, cameras, seen)
    placed = _placed(task, cameras, seen)
    usable = _usable(task, seen)
    for said in left_out(task, usable):
        note(said)
    return usable, placed


def _camera(
    name: str,
    sensor: SensorTask,
    views: Sequence[CornerView],
    planes: Sequence[PlaneView],
    note: Callable[[str], None],
) -> Camera:
    if sensor.fixed_intrinsics or (sensor.factory and not views):
        return sensor.factory[0]
    if not views:
        raise NotSolvedError(f"{name}: sees no corners, so its intrinsics have to be given and kept")
    known = sensor.factory or (initial_camera(sensor.width, sensor.height, sensor.lens, views),)
    note(f"{name}: {len(views)} views, focal length about {known[0].fx:.0f} px to begin with")
    fit = fit_camera if sensor.factory else fit_unknown
    camera, free = fit(name, sensor, views, known[0]), sensor.lens.coefficients
    while free and not all(_has_inverse(camera, view) for view in planes):
        free = free[:-1]  # coarse corners may leave a lens that folds back beyond them, where planes were measured
        fixed = (*sensor.fixed, *sensor.lens.coefficients[len(free) :])
        camera = fit(name, replace(sensor, fixed=fixed), views, known[0])
    return camera


def _has_inverse(camera: Camera, view: PlaneView) -> bool:
    try:
        camera.directions(view.pixels)
    except LensError:
        return False
    return True


def fit_unknown(name: str, sensor: SensorTask, views: Sequence[CornerView], first: Camera) -> Camera:
    """Camera fitted as by `fit_camera`, of which nothing is known, from `first` or else from an ordinary focal length.

    Where boards face the camera, what a lens bends looks like a focal length that is many times too short.

    Raises:
        NotSolvedError: neither leads to a minimum.
    """
    try:
        return fit_camera(name, sensor, views, first)
    except NotSolvedError:
        return fit_camera(name, sensor, views, plain_camera(sensor.width, sensor.height, sensor.lens, sensor.width))


def fit_camera(name: str, sensor: SensorTask, views: Sequence[CornerView], first: Camera) -> Camera:
    """Camera fitted to the corners of one sensor alone, with free intrinsics, in its own frame.

    Raises:
        NotSolvedError: no view has a valid board pose.
    """
    for simpler in sensor.lens.simpler:  # numerator and denominator of a rational lens are redundant without distortion
        if first.lens.is_pinhole:
            first = fit_camera(name, sensor.with_lens(simpler), views, first)
    boards = {view.shot: found[0].T_sb for view in views if (found := pose_candidates(first, view))}
    if not boards:
        raise NotSolvedError(f"{name}: no view shows a board that its camera could have seen")
    free = replace(sensor, fixed_intrinsics=False, fixed_pose=False, free_running=False, depth_terms=())
    task = Task({name: free}, views, (), name).of_shots([*boards])
    state = State({name: SensorState(replace(first, T_rs=pose.identity()))}, boards)
    return search(formulate(task).as_measured(state)).sensors[name].camera


def _numbered_alike(
    task: Task, cameras: Mapping[str, Camera], seen: Mapping[str, Mapping[int, list[PoseCandidate]]]
) -> tuple[Task, dict[str, dict[int, list[PoseCandidate]]]]:
    """Task and pose candidates with corners numbered from the same end of the board in all sensors of a shot."""
    poses = extrinsics_graph.poses(symmetric_boards.both_ways(seen, task.corners), next(iter(seen)))
    placed = {name: replace(cameras[name], T_rs=T_0s) for name, T_0s in poses.items()}
    corners = symmetric_boards.numbered_alike(task.corners, placed)
    found: dict[str, dict[int, list[PoseCandidate]]] = {name: {} for name in seen}
    for view in corners:
        if candidates := pose_candidates(cameras[view.sensor], view):
            found[view.sensor][view.shot] = candidates
    return replace(task, corners=corners), found


def _placed(task: Task, cameras: Mapping[str, Camera], seen: extrinsics_graph.PoseCandidates) -> State:
    T_r0 = pose.identity()
    if task.sensors[task.reference].factory:
        T_r0 = task.sensors[task.reference].factory[0].T_rs
    root = task.reference if task.reference in seen else next(iter(seen))
    poses = extrinsics_graph.poses(seen, root)
    poses |= _known(task, poses)
    boards = {shot: _board(shot, task, cameras, poses, seen) for shot in _shots(seen)}
    for name in task.sensors:
        if name not in poses:
            views = [view for view in task.planes if view.sensor == name]
            poses[name] = registration.register(name, cameras[name], views, boards)
    # Up to here the frame is that of a sensor with corners.
    T_rx = T_r0 @ pose.inverse(poses[task.reference])
    sensors = {name: SensorState(replace(cameras[name], T_rs=T_rx @ poses[name])) for name in task.sensors}
    return State(sensors, {shot: T_rx @ board for shot, board in boards.items()})


def _known(task: Task, poses: Mapping[str, Pose]) -> dict[str, Pose]:
    """Fixed poses, and that of the reference with them, in the frame of the given poses."""
    fixed = [name for name, sensor in task.sensors.items() if sensor.fixed_pose]
    given = {name: task.sensors[name].factory[0].T_rs for name in ([task.reference, *fixed] if fixed else [])}
    anchor = next((name for name in given if name in poses), None)
    return (
        {}
        if anchor is None
        else {name: poses[anchor] @ pose.inverse(given[anchor]) @ T_rs for name, T_rs in given.items()}
    )


def _board(
    shot: int,
    task: Task,
    cameras: Mapping[str, Camera],
    poses: Mapping[str, Pose],
    seen: extrinsics_graph.PoseCandidates,
) -> Pose:
    """Pose candidate with the smallest reprojection error over all sensors."""
    allowed = [poses[name] @ each.T_sb for name in seen for each in seen[name].get(shot, ())]
    views = [view for view in task.corners if view.shot == shot]
    placed = {view.sensor: replace(cameras[view.sensor], T_rs=poses[view.sensor]) for view in views}

    def misfit(board: Pose) -> float:
        total = 0.0
        for view in views:
            misses = placed[view.sensor].project(pose.transform(board, view.points_b)) - view.pixels
            total += float(np.sum(np.minimum(np.nan_to_num(np.hypot(*misses.T), nan=FAR_PX), FAR_PX) ** 2))
        return total

    return min(allowed, key=misfit)


def _shots(seen: extrinsics_graph.PoseCandidates) -> list[int]:
    return sorted({shot for found in seen.values() for shot in found})


def _usable(task: Task, seen: extrinsics_graph.PoseCandidates) -> Task:
    """Task without corner views that have no valid pose, and without planes of shots without corners."""
    shots = set(_shots(seen))
    return replace(
        task,
        corners=[view for view in task.corners if view.shot in seen.get(view.sensor, {})],
        planes=[view for view in task.planes if view.shot in shots],
    )


def left_out(task: Task, usable: Task) -> list[str]:
    """Sentences that count the views of each sensor that are not used, and say why."""
    found = []
    for views, kept, why in (
        (task.corners, usable.corners, "images show a board where its camera could not have seen one"),
        (task.planes, usable.planes, "shots have distances, but no sensor's corners tell where the board is"),
    ):
        for name in task.sensors:
            all_shots, shots = ({view.shot for view in each if view.sensor == name} for each in (views, kept))
            if lost := sorted(all_shots - shots):
                numbers = ", ".join(map(str, lost))
                wide = views is task.corners and task.sensors[name].lens is FISHEYE
                reach = ", or beyond 90° from its axis, where a fisheye ends here" if wide else ""
                found.append(f"{name}: {len(lost)} of {len(all_shots)} {why}{reach}; left out: {numbers}")
    return found
