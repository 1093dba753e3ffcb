"""Reports of calibration commands: complete, safe against their own texts, the same numbers in both forms."""

import functools
import json
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from abs_service.report import figures, page, provenance
from abs_service.report.content import Column, Level, Report, Section, Table, Verdict, drawing, photo, to_json

NOON = 1_795_262_400_000_000_000
ORIGIN = provenance.Provenance("abs-service calibrate rig x.toml", "2026-11-21T12:00:00Z")
BAD = Verdict(Level.BAD, "has moved by 4 mm & more", "Put it back.", "color")


class Elements(HTMLParser):
    """Collects the elements and the text of a page, and insists that all that is opened is closed."""

    VOID = frozenset({"meta", "img"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@functools.cache
def sections() -> tuple[Section, ...]:
    columns = (Column("sensor"), Column("fx", "px", ".2f"), Column("views"), Column("verdict"))
    table = Table("Cameras", columns, (("<tof>", 504.1239, 14, Level.GOOD), ("color", float("nan"), None, "-")))
    residuals = np.array([[0.1, 0.2], [-0.3, 0.0]])
    field = figures.residual_field(np.array([[10.0, 20.0], [50.0, 30.0]]), residuals, 64, 48)
    grey = photo(np.zeros((4, 6), np.uint8), "A grey picture", 'black "all over"')
    return (Section("Cameras", ("a < b", table)), Section("Residuals", (drawing(field, "c", "d"), grey)))


def report(*verdicts: Verdict) -> Report:
    return Report(
        "Rig <demo>", ORIGIN, verdicts, sections(), {"rms_px": np.float64(0.25), "bias": np.array([np.nan, 1])}
    )


def test_the_page_needs_nothing_from_elsewhere_and_every_picture_has_words() -> None:
    elements = Elements(page.to_html(report(BAD))).found
    sources = [attributes["src"] or "" for _, attributes in elements if "src" in attributes]
    assert len(sources) == 2
    assert all(source.startswith("data:image/") for source in sources)
    assert all(attributes["alt"] for tag, attributes in elements if tag == "img")
    assert not {"script", "link", "iframe"} & {tag for tag, _ in elements}


def test_texts_appear_as_they_are_and_never_as_markup() -> None:
    shown = Elements(page.to_html(report(BAD))).text
    for text in ("Rig <demo>", "a < b", "<tof>", "has moved by 4 mm & more", "Put it back.", ORIGIN.command):
        assert text in shown


def test_both_forms_hold_the_same_numbers() -> None:
    made = report(BAD)
    data = json.loads(json.dumps(to_json(made), allow_nan=False))
    rows = data["sections"][0]["blocks"][1]["table"]["rows"]
    assert rows == [["<tof>", 504.1239, 14, "good"], ["color", None, None, "-"]]
    assert "504.12" in Elements(page.to_html(made)).text
    assert data["values"] == {"rms_px": 0.25, "bias": [None, 1.0]}
    assert data["verdicts"] == [
        {"level": "bad", "text": "has moved by 4 mm & more", "advice": "Put it back.", "about": "color"}
    ]


@pytest.mark.parametrize(
    ("levels", "worst"), [((), 0), ((Level.GOOD,), 0), ((Level.GOOD, Level.DOUBTFUL), 1), ((Level.BAD, Level.GOOD), 2)]
)
def test_the_worst_verdict_is_the_exit_code(levels: tuple[Level, ...], worst: int) -> None:
    made = report(*(Verdict(level, "said") for level in levels))
    assert made.level == worst
    assert to_json(made)["exit_code"] == worst


def test_the_same_report_is_the_same_file(tmp_path: Path) -> None:
    first, data = page.write(report(BAD), tmp_path / "a.html")
    sections.cache_clear()  # drawn anew
    second, _ = page.write(report(BAD), tmp_path / "b")
    assert first.read_bytes() == second.read_bytes()
    assert data == tmp_path / "a.json"


def test_a_report_that_cannot_be_written_says_where(tmp_path: Path) -> None:
    with pytest.raises(page.ReportFileError, match="absent"):
        page.write(report(), tmp_path / "absent" / "a.html")


def test_provenance_names_data_by_content_and_no_home(tmp_path: Path) -> None:
    shots = tmp_path / "my shots"
    shots.mkdir()
    (shots / "1.png").write_bytes(b"abc")
    given = ["calibrate", "rig", str(shots), "--out", "x.toml"]
    made = provenance.trace(given, [shots, shots / "1.png"], lambda: NOON, tmp_path)
    assert made.command == "abs-service calibrate rig ~/'my shots' --out x.toml"
    assert made.date == "2026-11-21T12:00:00Z"
    assert made.data[1] == provenance.DataFile(
        "1.png", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    )
    (shots / "1.png").rename(shots / "2.png")
    assert provenance.fingerprint(shots) != made.data[0]


def test_data_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(provenance.DataError, match="gone"):
        provenance.fingerprint(tmp_path / "gone")


def test_coverage_counts_parts_of_the_image() -> None:
    corners = np.array([[0.0, 0.0], [1.0, 1.0], [79.4, 59.4], [200.0, 10.0]])
    axes, _ = figures.coverage_map([corners[:2], corners], 80, 60).axes
    shown = axes.collections[0].get_array()
    assert shown is not None
    assert shown.max() == 2


def test_a_map_shows_unknown_pixels_as_such_and_its_bar_ignores_single_ones() -> None:
    values = np.tile(np.linspace(1.0, 2.0, 40), (30, 1))
    values[0, 0], values[1, 1] = np.nan, 1e9
    axes, bar = figures.image_map(values, "deviation [mm]").axes
    assert axes.images[0].get_clim()[1] < 2.1
    assert bar.get_title().startswith("grey: none")
    assert figures.difference_map(values - 1.5, "bias").axes[0].images[0].get_clim() == pytest.approx(
        (-0.5, 0.5), abs=0.05
    )


def test_maps_and_fields_of_nothing_are_drawn_all_the_same() -> None:
    empty = np.zeros((0, 2))
    for figure in (
        figures.residual_field(empty, empty, 64, 48),
        figures.coverage_map([], 64, 48),
        figures.image_map(np.full((4, 6), np.nan), "x"),
    ):
        assert drawing(figure, "c", "a").content.startswith(b"<?xml")


def test_tables_without_rows_are_left_out_of_the_page() -> None:
    empty = Section("Views", (Table("nothing was seen", (Column("view"),), ()), "That is all."))
    shown = page.to_html(Report("Rig", ORIGIN, (), (empty,)))
    assert "nothing was seen" not in shown
    assert "That is all." in shown


def test_counted_coverage_is_what_the_map_shows() -> None:
    corners = np.array([[1.0, 1.0], [70.0, 50.0]])
    assert np.count_nonzero(figures.coverage_counts([corners, corners[:1]], 80, 60)) == 2
    assert figures.coverage_counts([corners, corners[:1]], 80, 60).max() == 2


@pytest.mark.parametrize("ending", ["html", "json"])
def test_a_report_replaces_an_earlier_one_and_nothing_else(tmp_path: Path, ending: str) -> None:
    path = tmp_path / "lab.toml"
    page.check_replaceable(path)
    page.write(report(BAD), path)
    page.check_replaceable(path)
    (tmp_path / f"lab.{ending}").write_text('{"of": "the user"}')
    with pytest.raises(page.ReportFileError, match=rf"lab\.{ending}: exists and is no report"):
        page.check_replaceable(path)
