"""The pages of docs/ and the files that they name exist."""

import re
import subprocess
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]


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


def _tracked(*patterns: str) -> list[str]:
    return subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
