"""The house's language: docstrings that state, and a glossary whose rows are complete."""

import ast
import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("abs_service", "calib", "client", "drivers", "evaluation", "examples", "tests")
SUPERLATIVES = {"largest", "longest", "farthest", "fewest", "least", "most", "smallest", "shortest", "widest"}
#: Beginnings of the middle of a sentence: the thing itself is missing.
FRAGMENT = re.compile(
    r"(After|Also|As|At|Beyond|Both|But|By|Does|From|If|In|Is|It|Its|More|Nothing|Of|Once|Only|Or|So many|Such|That"
    r"|Their|There|These|They|This|Those|To|Until|With|Within|Without)\b"
)
QUESTION = re.compile(r'^ *"""(What|How|Where|Whether|Which|Why|When|Who)(ever|se)?\b.*', re.MULTILINE)


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_docstring_says_what_a_thing_is_or_returns(folder):
    asking = [
        f"{path.relative_to(ROOT)}: {found[0].strip()}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for found in QUESTION.finditer(path.read_text(encoding="utf-8"))
    ]
    assert asking == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_docstring_begins_with_its_thing(folder):
    """Those of tests excepted: they continue the sentence that is the name."""
    fragments = [
        f"{path.relative_to(ROOT)}: {text}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for text in docstrings(ast.parse(path.read_text(encoding="utf-8")))
        if FRAGMENT.match(text)
    ]
    assert fragments == []


def docstrings(module):
    """First lines of the docstrings of a module, its classes and functions, without tests."""
    for node in ast.walk(module):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and not is_test(node):
            yield (ast.get_docstring(node) or "-").splitlines()[0]


def is_test(node):
    """True for a test, whose name is a sentence."""
    return getattr(node, "name", "").startswith("test_")


@pytest.mark.parametrize("folder", FOLDERS)
def test_names_use_the_standard_terms(folder):
    """Of the conventions: received, reported, typical and recent; the name of a test is a sentence."""
    found = {
        f"{path.relative_to(ROOT)}: {token.string}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for token in tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
        if token.type == tokenize.NAME
        and not token.string.startswith("test_")
        and {"heard", "told", "usual", "lately"} & set(token.string.lower().split("_"))
    }
    assert found == set()


@pytest.mark.parametrize("folder", FOLDERS)
def test_bounds_are_named_minimum_and_maximum(folder):
    """Constants, arguments and fields; results such as the longest gap of a recording keep their words."""
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for name in bounds(ast.parse(path.read_text(encoding="utf-8")))
        if SUPERLATIVES & set(name.lower().split("_"))
    }
    assert found == set()


def bounds(module):
    """Names that may be bounds: of constants, arguments and fields of classes."""
    for node in ast.walk(module):
        match node:
            case ast.arg(arg=name):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) if name.isupper():
                yield name
            case ast.AnnAssign(target=ast.Name(id=name)):
                yield name


def test_every_row_of_the_glossary_has_all_columns():
    page = (ROOT / "CONVENTIONS.md").read_text(encoding="utf-8")
    rows = [line for line in page.partition("## Glossary")[2].partition("\n## ")[0].splitlines() if line[:1] == "|"]
    assert [row for row in rows if row.count("|") != rows[0].count("|")] == []
    assert len(rows) > 50


def test_every_place_in_the_glossary_exists():
    page = (ROOT / "CONVENTIONS.md").read_text(encoding="utf-8")
    places = re.findall(r"`([\w/.]+(?:/|\.py)[\w/]*)`", page.partition("## Glossary")[2].partition("\n## ")[0])
    rooms = [ROOT, ROOT / "abs_service", ROOT / "abs_service" / "tracker"]  # the glossary abbreviates paths
    assert [place for place in places if not any((room / place).exists() for room in rooms)] == []
    assert len(places) > 30


#: Words of a sentence, from this number on it is two.
LONG_SENTENCE = 40


def sentences(page):
    """Sentences of a page's prose; code, links and formulas count as one word each."""
    prose = re.sub(r"^ *```.*?^ *```$", "", page, flags=re.DOTALL | re.MULTILINE)
    prose = re.sub(r"^(\||#).*$", "", prose, flags=re.MULTILINE)
    prose = re.sub(r"`[^`]*`|\]\([^)]*\)|\$[^$]*\$", lambda found: " Word" if found[0][0] != "]" else "]", prose)
    for paragraph in re.split(r"\n\s*\n|\n\s*(?:[-*]|\d+\.) ", prose):
        if " · " not in paragraph:  # a list of links
            yield from re.split(r"(?<=[.!?:])[*_)\"]*\s+(?=[^a-z])", " ".join(paragraph.split()))


def test_sentences_of_the_pages_are_short():
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    long = [
        f"{page.relative_to(ROOT)}: {sentence}"
        for page in pages
        for sentence in sentences(page.read_text(encoding="utf-8"))
        if len(re.findall(r"\S*\w\S*", sentence)) >= LONG_SENTENCE
    ]
    assert long == []
