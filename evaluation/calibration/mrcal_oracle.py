"""Calibrates one camera with mrcal 2.2; a program for the system's Python, which alone has Debian's python3-mrcal.

Reads JSON from standard input: `size` (2,) [px], `spacing` [m], `intrinsics` (9,) to start from, `boards` (n, 6) as
rotation vectors and translations to the camera, `observations` (n, rows, columns, 3) of x, y [px] and a weight that is
negative for missing corners, and `points` (m, 3) [m]. Writes JSON: `rms` [px], `intrinsics` (9,), `pixels` (m, 2) of
the points, `deviations` (m,) of their projections along the worst direction [px].
"""

import json
import sys

import numpy as np


def main() -> None:
    """Solves, and writes what mrcal states."""
    import mrcal  # pyright: ignore[reportMissingImports]  # noqa: PLC0415  of the system's Python

    given = json.load(sys.stdin)
    observations = np.array(given["observations"], float)
    count = len(observations)
    indices = np.stack([np.arange(count), np.zeros(count), np.full(count, -1)], axis=1).astype(np.int32)
    inputs = {
        "intrinsics": np.array([given["intrinsics"]], float),
        "extrinsics_rt_fromref": np.zeros((0, 6)),
        "frames_rt_toref": np.array(given["boards"], float),
        "points": None,
        "observations_board": observations,
        "indices_frame_camintrinsics_camextrinsics": indices,
        "observations_point": None,
        "indices_point_camintrinsics_camextrinsics": None,
        "lensmodel": "LENSMODEL_OPENCV5",
        "calobject_warp": None,
        "imagersizes": np.array([given["size"]], dtype=np.int32),
        "calibration_object_spacing": given["spacing"],
        "do_optimize_intrinsics_core": True,
        "do_optimize_intrinsics_distortions": True,
        "do_optimize_extrinsics": True,
        "do_optimize_frames": True,
        "do_optimize_calobject_warp": False,
        "do_apply_outlier_rejection": False,
        "do_apply_regularization": False,
        "verbose": False,
    }
    stats = mrcal.optimize(**inputs)
    model = mrcal.cameramodel(optimization_inputs=inputs, icam_intrinsics=0)
    points = np.array(given["points"], float)
    deviations = mrcal.projection_uncertainty(points, model, what="worstdirection-stdev")
    answer = {
        "rms": float(stats["rms_reproj_error__pixels"]),
        "intrinsics": model.intrinsics()[1].tolist(),
        "pixels": mrcal.project(points, *model.intrinsics()).tolist(),
        "deviations": np.asarray(deviations).tolist(),
    }
    json.dump(answer, sys.stdout)


if __name__ == "__main__":
    main()
