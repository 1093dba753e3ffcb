"""The pages of docs/: those that code and messages name exist, and troubleshooting has what a tracker says."""

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import yaml

from abs_service.tracker.estimates import status
from abs_service.tracker.estimates.shape_quality import ShapeQuality
from abs_service.tracker.terms.sensor_fit import Remainder, RimFit, SensorFit
from abs_service.tracker.terms.vertex_counts import VertexCounts

ROOT = Path(__file__).parents[2]
TROUBLESHOOTING = (ROOT / "docs" / "how-to" / "troubleshooting.md").read_text(encoding="utf-8")


def test_every_page_that_a_file_names_exists():
    """Comments and messages name pages by their path; links are checked by `make docs`."""
    named = {
        (path, page)
        for path in _tracked("*.py", "*.toml", "*.md", "Makefile", "docker/*")
        for page in re.findall(r"docs/[\w/-]+\.(?:md|png|svg)", (ROOT / path).read_text(encoding="utf-8"))
    }
    assert len(named) > 20
    assert [f"{path}: {page}" for path, page in sorted(named) if not (ROOT / page).exists()] == []


def test_every_file_that_a_page_names_exists():
    """`x.py` stands for a file of the reader's own; decisions and the list of changes tell of files that were."""
    past = re.compile(r"docs/decisions/|CHANGELOG")
    named = {
        (path, file)
        for path in _tracked("*.md")
        if not past.match(path)
        for file in re.findall(
            r"\b(?:abs_service|calib|drivers|evaluation|examples|tests)/[\w/]+\.(?:py|toml)\b",
            (ROOT / path).read_text(encoding="utf-8"),
        )
        if not file.endswith("/x.py")
    }
    assert len(named) > 50
    assert [f"{path}: {file}" for path, file in sorted(named) if not (ROOT / file).exists()] == []


def test_every_page_of_the_four_parts_is_in_the_navigation():
    text = re.sub(r"!!python\S*", "", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    listed = set(re.findall(r"[\w/-]+\.md", str(yaml.safe_load(text)["nav"])))
    written = {
        path.relative_to(ROOT / "docs").as_posix()
        for folder in ("tutorial", "how-to", "explanation", "reference")
        for path in (ROOT / "docs" / folder).rglob("*.md")
    }
    assert written <= listed


def test_every_decision_has_a_number_of_its_own():
    pages = sorted(path.name for path in (ROOT / "docs" / "decisions").glob("[0-9]*.md"))
    assert [name[:4] for name in pages] == [f"{number:04}" for number in range(len(pages))]


def test_troubleshooting_has_every_reason_of_a_status():
    counts = VertexCounts(400, 10, 90, missing=300)
    nothing_right = SensorFit("tof", 100, 300, 100, 10, -1.0, 1.0, RimFit(20, 10, 10), counts, Remainder(0.9, 0.0))
    doubtful = replace(nothing_right, inliers=50)
    out_of_sight = replace(nothing_right, inliers=100, occluded=50)
    surprised = replace(nothing_right, remainder=Remainder(), is_surprised=True)
    within = replace(nothing_right, rim=RimFit(20, 0, 20))
    bad = ShapeQuality(folded_share=0.5, deviation_m=1.0, single_frame_deviation_m=1.0)
    found = [
        status.judge([fit], ["color"], bad, 9.9, status.Settings())[1]
        for fit in (nothing_right, doubtful, out_of_sight, surprised, within)
    ]
    assert [len(reasons) for reasons in found] == [8, 8, 8, 8, 8]
    found.append(
        status.judge([nothing_right], (), ShapeQuality(single_frame_deviation_m=1.0), 0.0, status.Settings())[1]
    )
    reasons = {reason for of in found for reason in of}
    assert len(reasons) == 14
    page = _without_numbers(TROUBLESHOOTING)
    assert [reason for reason in reasons if _without_numbers(reason.partition(" so far")[0]) not in page] == []


def _without_numbers(text: str) -> str:
    return re.sub(r"\d+", "#", " ".join(text.split()))


def _tracked(*patterns: str) -> list[str]:
    return subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
