import re
import string
import tomllib

import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from abs_service.config.positions import key_lines, located
from abs_service.config.problems import Problem

TEXT = '''# comment with [brackets] = "and quotes
a = 1.5 # not a table: [b]
"quoted key" = 'x = 1'
b.c = { d = [1, "]"], "e.f" = 2 }
long = """
[not.a.table]
no = "key"
"""
list = [
  [1, 2], # first
  [3,
   4],
]

[devices.sim]
uri = "simulated://sheet"
when = 1979-05-27 07:32:00

[[data]]
name = "first"
[[data]]
name = "second"
[data.deep]
er = 1
'''


def test_lines_of_everything_that_toml_can_hold():
    assert key_lines(TEXT) == {
        ("a",): 2,
        ("quoted key",): 3,
        ("b",): 4,
        ("b", "c"): 4,
        ("b", "c", "d"): 4,
        ("b", "c", "d", 0): 4,
        ("b", "c", "d", 1): 4,
        ("b", "c", "e.f"): 4,
        ("long",): 5,
        ("list",): 9,
        ("list", 0): 10,
        ("list", 0, 0): 10,
        ("list", 0, 1): 10,
        ("list", 1): 11,
        ("list", 1, 0): 11,
        ("list", 1, 1): 12,
        ("devices",): 15,
        ("devices", "sim"): 15,
        ("devices", "sim", "uri"): 16,
        ("devices", "sim", "when"): 17,
        ("data",): 19,
        ("data", 0): 19,
        ("data", 0, "name"): 20,
        ("data", 1): 21,
        ("data", 1, "name"): 22,
        ("data", 1, "deep"): 23,
        ("data", 1, "deep", "er"): 24,
    }


words = st.text(string.ascii_letters + string.digits + " .#[]{}=,'\"\\\n", min_size=1, max_size=8)
values = st.recursive(
    st.integers(-9, 9) | st.booleans() | st.floats(-2, 2) | words | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
    max_leaves=12,
)


def paths(value, at=()):
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield (*at, key)
        yield from paths(inner, (*at, key))


@given(st.dictionaries(words, values, max_size=4), st.booleans())
def test_every_key_is_found_on_a_line_that_names_it(tables, multiline):
    text = tomli_w.dumps(tables, multiline_strings=multiline)
    found = key_lines(text)
    assert set(found) == set(paths(tomllib.loads(text)))
    lines = text.splitlines()
    for path, line in found.items():
        if isinstance(path[-1], str) and re.fullmatch(r"\w+", path[-1]):
            assert path[-1] in lines[line - 1]


def test_what_is_missing_is_on_the_line_of_the_table_around_it():
    problems = [Problem(("devices", "sim", "controls", "x"), "b"), Problem(("a",), "a", 1), Problem(("zzz",), "z")]
    assert located(problems, TEXT) == ["zzz: z", "line 2: a = 1: a", "line 15: devices.sim.controls.x: b"]


def test_tables_without_a_text_have_no_lines():
    assert located([Problem(("a",), "b")], "") == ["a: b"]
