"""Drawings are found in the page of a report, by their alternative text."""

import sys
from pathlib import Path

import pytest

from abs_service.report import page, plots
from abs_service.report.content import Report, Section, drawing
from abs_service.report.provenance import Provenance
from evaluation.pictures import of_report


@pytest.fixture
def report(tmp_path: Path) -> Path:
    drawn = [drawing(plots.figure(2, size), "", alt) for size, alt in ((1, 'Edges & "masks"'), (2, "Errors"))]
    path, _ = page.write(Report("X", Provenance("", ""), (), (Section("Y", tuple(drawn)),), {}), tmp_path / "r.html")
    return path


def test_the_drawing_that_is_named_is_written(report: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = report.with_name("edges.svg")
    monkeypatch.setattr(sys, "argv", ["of_report", str(report), 'Edges & "m', str(out)])
    of_report.main()
    text = out.read_text(encoding="utf-8")
    assert text.startswith("<?xml")
    assert 'height="72pt"' in text  # an inch, the first of both


def test_what_names_no_drawing_or_several_is_an_error(report: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["of_report", str(report), "E", "x.svg"])
    with pytest.raises(SystemExit, match="names 2 drawings"):
        of_report.main()
