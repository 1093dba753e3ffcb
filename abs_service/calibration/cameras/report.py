"""Report and calibration file of `calibrate intrinsics` and `calibrate rig`."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from abs_service.calibration.cameras import figures as solve_figures
from abs_service.calibration.files.rig_file import Covariance, Residuals, RigCalibration, SensorCalibration
from abs_service.report import figures
from abs_service.report.content import Column, Level, Picture, Report, Section, Table, Verdict, drawing
from abs_service.report.provenance import Provenance
from calib.board.distinct import counts_of
from calib.solve.rounding import rounded
from calib.solve.solution import Parameter, Solution, ViewFit
from calib.solve.validation.projection_uncertainty import reach
from calib.solve.validation.verdict import Assessment

#: Difference of the two focal lengths from which on pixels are not called square; sensors' are to better than 0.3 %.
ASPECT = 0.01


def report(title: str, origin: Provenance, solution: Solution, found: Assessment, notes: Sequence[str]) -> Report:
    """The report of a solved calibration."""
    verdicts = [Verdict(Level.GOOD if found.trusted else Level.DOUBTFUL, found.verdict)]
    verdicts += [Verdict(Level.DOUBTFUL, reason) for reason in found.reasons[1:]]
    sections = [_cross_validation(found), *(_sensor(name, solution, found) for name in solution.task.sensors)]
    sections += [Section("Images that were not used", tuple(notes))] if notes else []
    poses = counts_of([*solution.task.corners, *solution.task.planes], solution.task.poses)
    values = {
        "trusted": found.trusted,
        "distance_m": found.distance,
        "poses": poses,
        "contradicting": [asdict(each) for each in found.contradicting],
        "parameters": {each.name: {"value": each.value, "sigma": each.sigma} for each in solution.parameters},
        "deviations": dict(solution.deviations),
        "halves": {
            each.of: {"difference_px": each.difference_px, "predicted_px": each.predicted_px}
            for each in found.agreements
        },
        "projection_sigma_px": {of: field.rms for of, field in {**found.images, **found.pairs}.items()},
        "views": [
            {"sensor": v.sensor, "shot": v.shot, "of": v.of, "rms": v.rms, "outliers": int(v.outliers.sum())}
            for v in solution.views
        ],
    }
    return Report(title, origin, tuple(verdicts), tuple(sections), values)


def calibration(
    name: str, origin: Provenance, solution: Solution, trusted: bool, kept: Mapping[str, SensorCalibration]
) -> RigCalibration:
    """Content of the calibration file; values of known sensors that do not concern the camera are kept."""
    sensors = {}
    for sensor, state in solution.state.sensors.items():
        before = kept.get(sensor, SensorCalibration(state.camera))
        task = solution.task.sensors[sensor]
        sensors[sensor] = SensorCalibration(
            state.camera,
            state.depth_offset,
            state.depth_scale,
            state.time_offset,
            before.noise,
            before.texture,
            before.factory or next(iter(task.factory), None),
            _residuals([view for view in solution.views if view.sensor == sensor], solution.task.poses),
        )
    count = solution.adjustment.layout.board_start
    names = tuple(solution.adjustment.layout.names[:count])
    views = tuple(view.digest for view in solution.task.corners)
    covariance = Covariance(names, solution.covariance[:count, :count], views)
    return RigCalibration(name, {**kept, **sensors}, origin, "good" if trusted else "doubtful", covariance)


def _residuals(views: Sequence[ViewFit], poses: Mapping[int, int]) -> Residuals:
    parts: dict[str, float | None] = {}
    for of in ("corners", "distances"):
        squares = [view.residuals.reshape(len(view.pixels), -1) for view in views if view.of == of]
        parts[of] = float(np.sqrt(np.mean(np.sum(np.concatenate(squares) ** 2, axis=1)))) if squares else None
    shots = {view.shot for view in views}
    return Residuals(parts["corners"], parts["distances"], len(shots), len({poses[shot] for shot in shots}))


def _cross_validation(found: Assessment) -> Section:
    rows = tuple((each.of, each.difference_px, each.predicted_px, each.ratio) for each in found.agreements)
    columns = (Column("projection"), Column("halves differ by", "px"), Column("predicted", "px"), Column("ratio"))
    known = tuple((of, field.rms, 2.45 * field.rms) for of, field in {**found.images, **found.pairs}.items())
    text = (
        "Two halves of the distinct poses were calibrated apart. If they differ by more than twice what noise alone "
        "predicts, something is wrong that residuals do not show. All numbers are root mean squares over the "
        f"part of the image in which boards were seen, at {found.distance:g} m. From one sensor to another nothing is "
        "compensated; within one image, a small motion of the camera is."
    )
    return Section(
        "Can it be trusted?",
        (
            text,
            Table("Halves of the shots", columns, rows),
            Table(
                "Uncertainty of projections from all shots",
                (Column("projection"), Column("deviation", "px"), Column("95 %", "px")),
                known,
            ),
            *(
                drawing(
                    solve_figures.cross_validation(each),
                    f"Halves, {each.of}",
                    f"Differences of the halves of {each.of}",
                )
                for each in found.agreements
            ),
        ),
    )


def cameras(solution: Solution) -> Iterator[str]:
    """A line for each sensor: its optics with their deviations, how corners fit, and the distances of the boards.

    Of one camera, nothing else shows squares that are described 10 times too large, or images that were all stretched.
    """
    for name in solution.task.sensors:
        own = {each.name: each for each in solution.parameters}
        free = [(key, own[f"{name}.{key}"]) for key in ("fx", "fy", "cx", "cy") if f"{name}.{key}" in own]
        known = [
            f"{key} {each.value:.{(digits := _digits(each.sigma))}f} ± {each.sigma:.{digits}f}" for key, each in free
        ]
        rms = [view.rms for view in solution.views if (view.sensor, view.of) == (name, "corners")]
        fit = [f"corners miss by {rounded(np.sqrt(np.mean(np.square(rms))))} px"] if rms else []
        near, far = reach(solution, name)
        boards = f"boards {rounded(near)} to {rounded(far)} m away{_stretched(own, name)}"
        yield f"{name}: {', '.join([*known, *fit, boards])}"


def _stretched(parameters: Mapping[str, Parameter], name: str) -> str:
    """End of a line on a camera whose pixels are not square; "" if they are, or if that is not known."""
    fx, fy = (parameters.get(f"{name}.{key}") for key in ("fx", "fy"))
    if fx is None or fy is None:
        return ""
    known = 5 * np.hypot(fx.sigma, fy.sigma) / fx.value
    if abs(fy.value / fx.value - 1) < max(ASPECT, known):
        return ""
    return (
        f"; fy is {fy.value / fx.value:.3f} times fx, as of images that were stretched: "
        "this calibration is for images that are stretched alike"
    )


def _digits(sigma: float) -> int:
    """Decimals that show two digits of a deviation."""
    return int(np.clip(1 - np.floor(np.log10(max(sigma, 1e-4))), 0, 4))


def _sensor(name: str, solution: Solution, found: Assessment) -> Section:
    rows = tuple(
        (each.name.partition(".")[2], each.value, each.sigma)
        for each in solution.parameters
        if each.name.startswith(f"{name}.")
    )
    columns = (Column("parameter"), Column("value", "px, rad, m, s", ".7g"), Column("deviation", "", ".2g"))
    shots = {view.shot for view in solution.views if view.sensor == name}
    poses = len({solution.task.poses[shot] for shot in shots})
    text = (
        f"{len(shots)} shots show {poses} distinct poses of the board. {_covered(name, solution)}Deviations come from "
        "how far the poses disagree. The file keeps what was not free as it was."
    )
    blocks: list[str | Table | Picture] = [text, Table(f"Estimated parameters of {name}", columns, rows)]
    return Section(name, (*blocks, *_pictures(name, solution, found)))


def _covered(name: str, solution: Solution) -> str:
    """Share of the cells of the coverage map in which there are corners; "" for a sensor without any."""
    camera = solution.cameras[name]
    pixels = [view.pixels for view in solution.views if (view.sensor, view.of) == (name, "corners")]
    if not pixels:
        return ""
    counts = figures.coverage_counts(pixels, camera.width, camera.height)
    return f"Corners were seen in {np.count_nonzero(counts)} of {counts.size} parts of the image, see its map. "


def _pictures(name: str, solution: Solution, found: Assessment) -> Iterator[Picture]:
    camera = solution.cameras[name]
    corners = [view for view in solution.views if (view.sensor, view.of) == (name, "corners")]
    planes = [view for view in solution.views if (view.sensor, view.of) == (name, "distances")]
    if corners:
        pixels = [view.pixels for view in corners]
        drawn = figures.coverage_map(pixels, camera.width, camera.height)
        yield drawing(drawn, "Detected corners", f"Coverage of the image of {name}")
        # Residuals in reports are measured minus predicted.
        residuals = -np.concatenate([view.residuals for view in corners])
        drawn = figures.residual_field(np.concatenate(pixels), residuals, camera.width, camera.height)
        yield drawing(drawn, "Residuals of corners", f"Residuals of corners over the image of {name}")
        yield drawing(solve_figures.view_errors(corners, "px", 1), "Views", f"Residuals of every view of {name}")
    fields = {of: field for of, field in found.pairs.items() if of.startswith(f"{name} → ")}
    if solution.adjustment.layout.free_parameters[name].intrinsics:
        fields = {name: found.images[name], **fields}
    for of, field in fields.items():
        label = f"deviation of a projection at {found.distance:g} m [px]"
        caption = f"Uncertainty of projections: {of} (hatched: no boards seen)"
        yield drawing(solve_figures.uncertainty_map(field, label), caption, f"Projection uncertainty of {of}")
    if planes:
        distances = {
            shot: float(np.linalg.norm(camera.T_sr[:3] @ T_rb[:, 3])) for shot, T_rb in solution.boards.items()
        }
        drawn = solve_figures.distance_errors(planes, distances)
        yield drawing(drawn, "Residuals of distances on boards", f"Residuals of the distances of {name}")
        yield drawing(solve_figures.view_errors(planes, "mm", 1e3), "Views", f"Residuals of the planes of {name}")
