"""The names that are promised, what they cost to import, and the examples that use them."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import abs_service as a

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
HEAVY = {"numpy", "numba", "cv2", "scipy", "pydantic", "mcap", "zenoh"}


def test_importing_the_package_imports_nothing_heavy():
    code = f"import sys, abs_service; print(sorted({HEAVY} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_promised_names_are_listed_and_others_refused():
    assert set(a.__all__) <= set(dir(a))
    assert a.__all__ == sorted(a.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Trakcer'"):
        getattr(a, "Trakcer")  # noqa: B009  a type checker knows already


def test_the_ten_lines_of_the_page_run(tmp_path):
    """With frames rendered in place of the reader's."""
    code = re.findall(r"```python\n(.*?)```", PAGE, re.S)[0]
    frames = "import numpy as np\ndepth = np.full((480, 640), np.nan)\ndepth[150:330, 200:440] = 0.8\n"
    program = frames + "frames = [(0.0, depth, None)]\n" + code
    found = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.startswith("TRACKING")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("example", "folder", "limit_mm"),
    [("toy_folder.py", "sl_rgbd_deform_petit", 1.5), ("kinect_paper.py", "sl_kinect_paper", 2.0)],
)
def test_an_example_tracks_its_folder(example, folder, limit_mm, data_set):
    command = [sys.executable, ROOT / "examples" / example, data_set(folder)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [line.split() for line, _ in zip(process.stdout, range(30))]
        process.kill()
    assert len(lines) == 30
    assert [status for _, status, *_ in lines].count("TRACKING") >= 28
    assert max(float(residual) for _, _, residual, _ in lines) < limit_mm


@pytest.mark.parametrize("name", ["toy_folder.py", "kinect_paper.py"])
def test_an_example_needs_only_the_public_face(name):
    text = (ROOT / "examples" / name).read_text(encoding="utf-8")
    assert re.findall(r"^(?:import|from) abs_service.*", text, re.M) == ["import abs_service as a"]
    assert len(text.splitlines()) <= 35


@pytest.mark.parametrize("name", ["toy_folder.py", "kinect_paper.py"])
@pytest.mark.parametrize("arguments", [[], ["missing"]])
def test_an_example_without_its_images_says_what_it_needs(name, arguments, tmp_path):
    command = [sys.executable, ROOT / "examples" / name, *arguments]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"{tmp_path.joinpath(*arguments)} holds no depth_" in done.stderr
    assert "Traceback" not in done.stderr
