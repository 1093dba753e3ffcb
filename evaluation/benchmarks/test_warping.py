"""Time to warp 640 × 576 distances into a view of 1280 × 720, compared with OpenCV in the same run."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from calib.warp.mesh import MeshWarp
from evaluation.inputs.warping.comparison import SCENES, SOURCE, TARGET, fastest_ms, opencv_alone_ms
from tests.calib.warp.scenes import image


@pytest.mark.parametrize("threads", [1, 2])
def test_warping_against_opencv(benchmark, threads):
    distance = image(SOURCE, SCENES["slanted plane"])
    with ThreadPoolExecutor(threads) as pool:
        warp = MeshWarp(SOURCE, TARGET, each=pool.map, parts=threads)
        benchmark(warp.warp, distance)
        ours, theirs = fastest_ms(lambda: warp.warp(distance)), opencv_alone_ms(SOURCE, TARGET, distance, dilate=True)
    benchmark.extra_info["times cv2.registerDepth, dilated"] = ours / theirs
    assert ours < 8 * theirs  # far off only if a kernel is not compiled or copies too much
